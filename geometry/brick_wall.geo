// A wall of bricks in running bond on a foundation.
//
// Open this file in Gmsh: the parameters stand in the side panel. Metres; the origin is the wall's lower left corner.
//
// What geomech reads: "bricks" is a zone of many surfaces, one block each; "foundation" holds them; "joint:bed" are the
// horizontal joints, "joint:head" the upright ones; "top" names the upper edge.

DefineConstant[
  courses = {10, Min 1, Max 200, Step 1, Name "Parameters/1Wall/courses", Label "Courses"},
  bricks = {8, Min 1, Max 200, Step 1, Name "Parameters/1Wall/bricks", Label "Bricks in a course"},
  length_m = {0.5, Min 0.001, Max 100, Step 0.05, Name "Parameters/2Brick/length_m", Label "Length [m]"},
  height_m = {0.25, Min 0.001, Max 100, Step 0.05, Name "Parameters/2Brick/height_m", Label "Height [m]"},
  foundation_m = {0.25, Min 0.001, Max 100, Step 0.05, Name "Parameters/3Foundation/foundation_m", Label "Depth [m]"}
];

size = height_m;
wide = bricks * length_m;
beds[] = {};
heads[] = {};
top[] = {};
p = 1;
n = 0;
For j In {0:courses - 1}
  odd = j - 2 * Floor(j / 2);
  For i In {0:bricks - 1 + odd}
    // Odd courses begin and end with half a brick.
    x0 = (i - 0.5 * odd) * length_m;
    x1 = x0 + length_m;
    x0 = (x0 < 0) ? 0 : x0;
    x1 = (x1 > wide) ? wide : x1;
    y0 = j * height_m;
    Point(p) = {x0, y0, 0, size};
    Point(p + 1) = {x1, y0, 0, size};
    Point(p + 2) = {x1, y0 + height_m, 0, size};
    Point(p + 3) = {x0, y0 + height_m, 0, size};
    Line(p) = {p, p + 1};
    Line(p + 1) = {p + 1, p + 2};
    Line(p + 2) = {p + 2, p + 3};
    Line(p + 3) = {p + 3, p};
    n = n + 1;
    Curve Loop(n) = {p, p + 1, p + 2, p + 3};
    Plane Surface(n) = {n};
    heads[] += {p + 1, p + 3};
    beds[] += {p};
    If (j == courses - 1)
      top[] += {p + 2};
    Else
      beds[] += {p + 2};
    EndIf
    p = p + 4;
  EndFor
EndFor
Physical Surface("bricks") = {1:n};

Point(p) = {-length_m, -foundation_m, 0, size};
Point(p + 1) = {wide + length_m, -foundation_m, 0, size};
Point(p + 2) = {wide + length_m, 0, 0, size};
Point(p + 3) = {-length_m, 0, 0, size};
Line(p) = {p, p + 1};
Line(p + 1) = {p + 1, p + 2};
Line(p + 2) = {p + 2, p + 3};
Line(p + 3) = {p + 3, p};
Curve Loop(n + 1) = {p, p + 1, p + 2, p + 3};
Plane Surface(n + 1) = {n + 1};
Physical Surface("foundation") = {n + 1};
beds[] += {p + 2};
Physical Curve("joint:bed") = {beds[]};
Physical Curve("joint:head") = {heads[]};
Physical Curve("top") = {top[]};
