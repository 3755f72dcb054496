DefineConstant[
  height_m = {20, Name "Parameters/height_m"},
  face_angle_deg = {63, Name "Parameters/face_angle_deg"}
];
crest = height_m / Tan(face_angle_deg * Pi / 180);
back = crest + 18;
size = height_m / 8;

// The rock: toe, foot of the back, top of the back, crest
Point(1) = {0, 0, 0, size};            Point(2) = {back, 0, 0, size};
Point(3) = {back, height_m, 0, size};  Point(4) = {crest, height_m, 0, size};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

// The base: a floor in front of the toe, below the rock and behind it
Point(5) = {-12, 0, 0, size};          Point(6) = {-12, -3, 0, size};
Point(7) = {back + 3, -3, 0, size};    Point(8) = {back + 3, height_m, 0, size};
Line(5) = {1, 5};  Line(6) = {5, 6};  Line(7) = {6, 7};  Line(8) = {7, 8};  Line(9) = {8, 3};
Curve Loop(2) = {5, 6, 7, 8, 9, -2, -1};
Plane Surface(2) = {2};

Physical Surface("rock") = {1};
Physical Surface("base") = {2};
