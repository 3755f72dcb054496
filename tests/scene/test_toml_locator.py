"""Lines of keys: compared with line numbers written into the values themselves, which tomllib reads independently."""

import tomllib

import pytest

from geomech.scene.locator import dotted, locate, path_of

# Every number below is the line on which its key stands.
DOCUMENT = '''\
top = 1
"quoted key" = 2   # comment with a [header] and = 99
a.b.c = 3
a.b."d.e" = 4
'literal \\ key' = 5

[table]
x = 8
[ table . "sub.table" ]
x = 10
inline = { y = 11, z = { w = 11 }, "v u".t = 11 }

[[items]]
n = 14
[[items]]
n = 16
[items.inner]
n = 18
[[items.deep]]
n = 20
[[items.deep]]
n = 22

[strings]
basic = "a \\" ] } # [not.a.table]"
n1 = 26
multi = """
[fake]
fake = 0 \\"""
"quoted" """
n2 = 31
literal = \'\'\'
fake = 0 \\\'\'\'
n3 = 34
ending = """five quotes"""""
n4 = 36
[arrays]
points = [
  [39, 39],   # ] comment
  [
    41, 41,
  ],
]
mixed = [ { n = 44 }, { n = 44 } ]
tables = [
  { n = 46 },
  { n = 47 },
]
date = 1979-05-27T07:32:00Z
n = 50
'''


def leaves(node, path=()):
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, (*path, key))
    elif isinstance(node, list):
        for k, value in enumerate(node):
            yield from leaves(value, (*path, k))
    else:
        yield path, node


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_every_number_is_on_its_own_line(ends):
    text = DOCUMENT.replace("\n", ends)
    lines = locate(text)
    numbers = [(path, value) for path, value in leaves(tomllib.loads(text)) if type(value) is int]
    assert len(numbers) == 28
    for path, value in numbers:
        assert lines[path] == value, path


def test_every_path_of_the_document_has_a_line():
    lines = locate(DOCUMENT)
    for path, _ in leaves(tomllib.loads(DOCUMENT)):
        for n in range(1, len(path) + 1):
            assert path[:n] in lines


def test_tables_have_the_line_of_their_header():
    lines = locate(DOCUMENT)
    assert lines["table",] == 7 and lines["table", "sub.table"] == 9
    assert lines["items", 0] == 13 and lines["items", 1] == 15
    assert lines["items", 1, "inner"] == 17 and lines["items", 1, "deep", 1] == 21


def test_dotted_paths_there_and_back():
    assert dotted(("loads", "tractions", 0, "edge")) == "loads.tractions[0].edge"
    assert dotted(("joints", "load:top", "x")) == 'joints."load:top".x'
    assert path_of('joints."a.b".cohesion_pa') == ("joints", "a.b", "cohesion_pa")
    assert path_of("geometry.cracks.1.angle_deg") == ("geometry", "cracks", "1", "angle_deg")
    assert path_of("geometry.cracks[1].angle_deg") == ("geometry", "cracks", "1", "angle_deg")
    assert path_of('joints."a[1].b".x') == ("joints", "a[1].b", "x")
    assert path_of("joints.load:top.x") == ("joints", "load:top", "x")
