// A circular tunnel in jointed rock, inside a frame that holds the rock around it. Metres; the origin is its centre.
//
// Open this file in Gmsh (gmsh tunnel.geo): the parameters stand in the side panel and the drawing follows them.
// What geomech reads: physical surfaces are zones; lines called "bolt:roof" are bolts, whose properties the scene gives;
// points called "monitor:…" are recorded. Joint sets come from the scene.

DefineConstant[
  radius_m = {3, Min 0.1, Max 50, Step 0.5, Name "Parameters/radius_m", Label "Radius [m]"},
  rock_m = {12, Min 0.2, Max 500, Step 1, Name "Parameters/rock_m", Label "Rock on each side of the centre [m]"},
  bolt_m = {3, Min 0.1, Max 50, Step 0.5, Name "Parameters/bolt_m", Label "Length of the bolts [m]"}
];

r = radius_m;
b = rock_m;
o = 1.15 * rock_m;
size = rock_m / 8;     // of the mesh that Gmsh shows; geomech meshes by itself

Point(1) = {0, 0, 0, size};
Point(2) = {r, 0, 0, size / 3};
Point(3) = {0, r, 0, size / 3};
Point(4) = {-r, 0, 0, size / 3};
Point(5) = {0, -r, 0, size / 3};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Circle(3) = {4, 1, 5};
Circle(4) = {5, 1, 2};
Curve Loop(1) = {1, 2, 3, 4};
// A name for the wall, for loads on it or a joint law of its own:
// Physical Curve("tunnel:wall") = {1, 2, 3, 4};

Point(11) = {-b, -b, 0, size};
Point(12) = {b, -b, 0, size};
Point(13) = {b, b, 0, size};
Point(14) = {-b, b, 0, size};
Line(11) = {11, 12};
Line(12) = {12, 13};
Line(13) = {13, 14};
Line(14) = {14, 11};
Curve Loop(2) = {11, 12, 13, 14};
Plane Surface(1) = {2, 1};
Physical Surface("rock") = {1};

Point(21) = {-o, -o, 0, size};
Point(22) = {o, -o, 0, size};
Point(23) = {o, o, 0, size};
Point(24) = {-o, o, 0, size};
Line(21) = {21, 22};
Line(22) = {22, 23};
Line(23) = {23, 24};
Line(24) = {24, 21};
Curve Loop(3) = {21, 22, 23, 24};
Plane Surface(2) = {3, 2};
Physical Surface("frame") = {2};

// Five bolts about the crown; they cut nothing.
For i In {-2:2}
  a = Pi / 2 + i * Pi / 9;
  Point(103 + 2 * i + 100) = {r * Cos(a), r * Sin(a), 0, size};
  Point(104 + 2 * i + 100) = {(r + bolt_m) * Cos(a), (r + bolt_m) * Sin(a), 0, size};
  Line(103 + i) = {103 + 2 * i + 100, 104 + 2 * i + 100};
EndFor
Physical Curve("bolt:roof") = {101:105};

Point(41) = {0.02 * r, 1.05 * r, 0, size};
Physical Point("monitor:crown") = {41};
