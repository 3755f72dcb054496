// A rectangular specimen with one flaw, between two platens. Metres; the origin is the centre of the specimen.
//
// Open this file in Gmsh (gmsh specimen.geo): the parameters stand in the side panel and the drawing follows them.
// What geomech reads: physical surfaces are zones; physical curves called "crack:NAME" are cracks; all other physical
// curves name edges, for loads and joints. More flaws: draw further lines and name them "crack:…".

DefineConstant[
  width_m = {0.050, Min 0.001, Max 10, Step 0.005, Name "Parameters/width_m", Label "Width [m]"},
  height_m = {0.100, Min 0.001, Max 10, Step 0.005, Name "Parameters/height_m", Label "Height [m]"},
  flaw_m = {0.015, Min 0.0001, Max 10, Step 0.001, Name "Parameters/flaw_m", Label "Length of the flaw [m]"},
  angle_deg = {45, Min -90, Max 90, Step 5, Name "Parameters/angle_deg", Label "Flaw from the horizontal [deg]"}
];

w = width_m / 2;
h = height_m / 2;
p = 0.2 * width_m;     // height of a platen
o = 1.1 * w;           // platens overhang, so that no corner of the specimen slides off as it widens
size = width_m / 20;   // of the mesh that Gmsh shows; geomech meshes by itself

Point(1) = {-w, -h, 0, size};
Point(2) = {w, -h, 0, size};
Point(3) = {w, h, 0, size};
Point(4) = {-w, h, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Surface("rock") = {1};

a = angle_deg * Pi / 180;
Point(11) = {-flaw_m / 2 * Cos(a), -flaw_m / 2 * Sin(a), 0, size / 5};
Point(12) = {flaw_m / 2 * Cos(a), flaw_m / 2 * Sin(a), 0, size / 5};
Line(11) = {11, 12};
Physical Curve("crack:flaw") = {11};

// Platens own their points: they touch the specimen and may part from it.
Point(21) = {-o, -h - p, 0, size};
Point(22) = {o, -h - p, 0, size};
Point(23) = {o, -h, 0, size};
Point(24) = {-o, -h, 0, size};
Line(21) = {21, 22};
Line(22) = {22, 23};
Line(23) = {23, 24};
Line(24) = {24, 21};
Curve Loop(2) = {21, 22, 23, 24};
Plane Surface(2) = {2};
Physical Surface("platen_bottom") = {2};

// The load stands on the middle part of the upper platen, as wide as the specimen.
Point(31) = {-o, h, 0, size};
Point(32) = {o, h, 0, size};
Point(33) = {o, h + p, 0, size};
Point(34) = {w, h + p, 0, size};
Point(35) = {-w, h + p, 0, size};
Point(36) = {-o, h + p, 0, size};
Line(31) = {31, 32};
Line(32) = {32, 33};
Line(33) = {33, 34};
Line(34) = {34, 35};
Line(35) = {35, 36};
Line(36) = {36, 31};
Curve Loop(3) = {31, 32, 33, 34, 35, 36};
Plane Surface(3) = {3};
Physical Surface("platen_top") = {3};
Physical Curve("load:top") = {34};
Physical Curve("contact:ends") = {1, 3, 23, 31};
