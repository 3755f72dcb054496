// A slope on a base that does not move. Metres; the origin is the toe; the slope faces left.
//
// Open this file in Gmsh (gmsh slope.geo): the parameters stand in the side panel and the drawing follows them.
// What geomech reads: physical surfaces are zones; physical curves called "joint:NAME" part the rock, "crack:NAME" are
// cracks in it, "bolt:NAME" bolts; all other physical curves name edges, for loads and joints.

DefineConstant[
  height_m = {15, Min 1, Max 500, Step 1, Name "Parameters/height_m", Label "Height [m]"},
  face_angle_deg = {65, Min 30, Max 89, Step 5, Name "Parameters/face_angle_deg", Label "Angle of the face [deg]"},
  crest_width_m = {20, Min 1, Max 500, Step 1, Name "Parameters/crest_width_m", Label "Behind the crest [m]"},
  base_m = {4, Min 0.5, Max 100, Step 1, Name "Parameters/base_m", Label "Thickness of the base [m]"}
];

brink = height_m / Tan(face_angle_deg * Pi / 180);
back = brink + crest_width_m;
size = height_m / 8;   // of the mesh that Gmsh shows; geomech meshes by itself

// The rock, counter-clockwise from the toe
Point(1) = {0, 0, 0, size};
Point(2) = {back, 0, 0, size};
Point(3) = {back, height_m, 0, size};
Point(4) = {brink, height_m, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Surface("rock") = {1};

// The base: below the rock, in front of the toe, and behind it, so that no side of the rock is free that is not in nature
Point(5) = {-height_m, 0, 0, size};
Point(6) = {-height_m, -base_m, 0, size};
Point(7) = {back + base_m, -base_m, 0, size};
Point(8) = {back + base_m, height_m, 0, size};
Line(5) = {1, 5};
Line(6) = {5, 6};
Line(7) = {6, 7};
Line(8) = {7, 8};
Line(9) = {8, 3};
Curve Loop(2) = {5, 6, 7, 8, 9, -2, -1};
Plane Surface(2) = {2};
Physical Surface("base") = {2};
