// A slope of columns that dip into it and topple, on a stepped base.
//
// Goodman & Bray (1976), "Toppling of rock slopes", ASCE Specialty Conference on Rock Engineering for Foundations and
// Slopes, Boulder, vol. 2, 201-234: columns of equal width on steps that climb at the base angle; their tops follow the
// face up to the crest and the ground above it. Open this file in Gmsh: the parameters stand in the side panel. Metres;
// the origin is the lowest corner of the first column; the slope faces left.
//
// What geomech reads: "columns" is a zone of many surfaces, one block each, "base" holds them; "joint:columns" is between
// the columns, "joint:base" under them.

DefineConstant[
  columns = {16, Min 2, Max 60, Step 1, Name "Parameters/1Columns/columns", Label "Number of columns"},
  crest_column = {10, Min 1, Max 60, Step 1, Name "Parameters/1Columns/crest_column", Label "Column at the crest"},
  width_m = {10, Min 0.01, Max 1000, Step 1, Name "Parameters/1Columns/width_m", Label "Width of a column [m]"},
  base_dip_deg = {30, Min 1, Max 60, Step 1, Name "Parameters/2Angles/base_dip_deg",
                  Label "Dip of the columns' feet out of the slope [deg]"},
  base_angle_deg = {35.8, Min 1, Max 80, Step 1, Name "Parameters/2Angles/base_angle_deg",
                    Label "Angle at which the steps climb [deg]"},
  face_angle_deg = {56.6, Min 1, Max 89, Step 1, Name "Parameters/2Angles/face_angle_deg", Label "Angle of the face [deg]"},
  crest_angle_deg = {4, Min -20, Max 60, Step 1, Name "Parameters/2Angles/crest_angle_deg",
                     Label "Angle of the ground above [deg]"}
];

// In the columns' own axes: t along the feet (up the slope), n along the columns.
a = base_dip_deg * Pi / 180;
c = Cos(a);
s = Sin(a);
a1 = width_m * Tan((face_angle_deg - base_dip_deg) * Pi / 180);
a2 = width_m * Tan((base_dip_deg - crest_angle_deg) * Pi / 180);
step = width_m * Tan((base_angle_deg - base_dip_deg) * Pi / 180);
size = width_m;

// Corner points: foot and head of either side of column i
foot[] = {};
joints[] = {};
feet[] = {};
p = 1;
tall = 0;
For i In {1:columns}
  If (i <= crest_column)
    tall = i * (a1 - step);
  Else
    tall = tall - a2 - step;
  EndIf
  If (tall < 0.05 * width_m)
    tall = 0.05 * width_m;
  EndIf
  t = (i - 1) * width_m;
  n = (i - 1) * step;
  Point(p) = {c * t - s * n, s * t + c * n, 0, size};
  Point(p + 1) = {c * (t + width_m) - s * n, s * (t + width_m) + c * n, 0, size};
  Point(p + 2) = {c * (t + width_m) - s * (n + tall), s * (t + width_m) + c * (n + tall), 0, size};
  Point(p + 3) = {c * t - s * (n + tall), s * t + c * (n + tall), 0, size};
  Line(p) = {p, p + 1};
  Line(p + 1) = {p + 1, p + 2};
  Line(p + 2) = {p + 2, p + 3};
  Line(p + 3) = {p + 3, p};
  Curve Loop(i) = {p, p + 1, p + 2, p + 3};
  Plane Surface(i) = {i};
  feet[] += {p};
  joints[] += {p + 1, p + 3};
  foot[] += {p, p + 1};
  p = p + 4;
EndFor
Physical Surface("columns") = {1:columns};

// The base: steps under the feet, a floor before them, closed far below. It owns its points: columns may part from it.
q = 1000;
t0 = -2 * width_m;
Point(q) = {c * t0, s * t0, 0, size};
first = q;
steps[] = {};
For i In {1:columns}
  t = (i - 1) * width_m;
  n = (i - 1) * step;
  q = q + 1;
  Point(q) = {c * t - s * n, s * t + c * n, 0, size};
  Line(q - 1) = {q - 1, q};
  steps[] += {q - 1};
  q = q + 1;
  Point(q) = {c * (t + width_m) - s * n, s * (t + width_m) + c * n, 0, size};
  Line(q - 1) = {q - 1, q};
  steps[] += {q - 1};
EndFor
// Behind the last column stands the abutment it would lean on; below, the ground.
x1 = c * (columns * width_m) - s * ((columns - 1) * step);
y1 = s * (columns * width_m) + c * ((columns - 1) * step);
Point(5001) = {x1 + 2 * width_m, y1, 0, size};
Point(5002) = {x1 + 2 * width_m, s * t0 - width_m, 0, size};
Point(5003) = {c * t0, s * t0 - width_m, 0, size};
Line(5001) = {q, 5001};
Line(5002) = {5001, 5002};
Line(5003) = {5002, 5003};
Line(5004) = {5003, first};
Curve Loop(1000) = {steps[], 5001, 5002, 5003, 5004};
Plane Surface(1000) = {1000};
Physical Surface("base") = {1000};
Physical Curve("joint:columns") = {joints[]};
Physical Curve("joint:base") = {feet[], steps[]};
