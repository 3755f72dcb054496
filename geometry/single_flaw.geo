// A rectangular specimen with one inclined flaw, between two platens.
//
// Open this file in Gmsh: the parameters stand in the side panel and the drawing follows them. A scene sets them with
//     [geometry]
//     model = "single_flaw.geo"
//     parameters = { angle_deg = 45 }
// using the last part of each name. Metres; the origin is the centre of the specimen.
//
// What geomech reads: physical surfaces are blocks ("rock", "platen_bottom", "platen_top"); physical curves called
// "crack:…" are cracks; all other physical curves name edges of blocks, for loads and joints.
//
// Specimen of Wong et al. (2002): 50 x 170 mm, a flaw of half-length 10 mm at 30 degrees from the horizontal.

DefineConstant[
  width_m  = {0.050, Min 0.001, Max 10, Step 0.005, Name "Parameters/1Specimen/width_m",  Label "Width [m]"},
  height_m = {0.170, Min 0.001, Max 10, Step 0.005, Name "Parameters/1Specimen/height_m", Label "Height [m]"},
  half_length_m = {0.010, Min 0.0001, Max 10, Step 0.001, Name "Parameters/2Flaw/half_length_m",
                   Label "Half-length [m]"},
  angle_deg = {30, Min -180, Max 180, Step 5, Name "Parameters/2Flaw/angle_deg", Label "From the horizontal [deg]"},
  centre_x_m = {0, Min -10, Max 10, Step 0.005, Name "Parameters/2Flaw/centre_x_m", Label "Centre, x [m]"},
  centre_y_m = {0, Min -10, Max 10, Step 0.005, Name "Parameters/2Flaw/centre_y_m", Label "Centre, y [m]"},
  platens = {2, Choices{0="none", 1="bottom", 2="both"}, Name "Parameters/3Platens/platens", Label "Platens"},
  platen_height_m = {0.010, Min 0.0001, Max 10, Step 0.005, Name "Parameters/3Platens/platen_height_m",
                     Label "Height [m]", Visible platens},
  platen_overhang_m = {0.005, Min 0, Max 10, Step 0.005, Name "Parameters/3Platens/platen_overhang_m",
                       Label "Overhang on each side [m]", Visible platens}
];

w = width_m / 2;
h = height_m / 2;
size = width_m / 20;   // of the mesh that Gmsh shows; geomech meshes by itself

// Specimen, counter-clockwise from its lower left corner
Point(1) = {-w, -h, 0, size};
Point(2) = { w, -h, 0, size};
Point(3) = { w,  h, 0, size};
Point(4) = {-w,  h, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

// The flaw, from its far end to the end its angle points to
a = angle_deg * Pi / 180;
Point(11) = {centre_x_m - half_length_m * Cos(a), centre_y_m - half_length_m * Sin(a), 0, size / 5};
Point(12) = {centre_x_m + half_length_m * Cos(a), centre_y_m + half_length_m * Sin(a), 0, size / 5};
Line(11) = {11, 12};
Line{11} In Surface{1};

Physical Surface("rock") = {1};
// Platens own their points: they touch the specimen and may part from it. Each overhangs the specimen, so that no
// corner of the specimen slides off as it widens.
p = platen_height_m;
o = w + platen_overhang_m;
If (platens >= 1)
  Point(21) = {-o, -h - p, 0, size};
  Point(22) = { o, -h - p, 0, size};
  Point(23) = { o, -h,     0, size};
  Point(24) = {-o, -h,     0, size};
  Line(21) = {21, 22};
  Line(22) = {22, 23};
  Line(23) = {23, 24};
  Line(24) = {24, 21};
  Curve Loop(2) = {21, 22, 23, 24};
  Plane Surface(2) = {2};
  Physical Surface("platen_bottom") = {2};
  Physical Curve("contact:bottom") = {1, 23};
Else
  Physical Curve("load:bottom") = {1};
EndIf
If (platens == 2)
  // The load stands on the middle part, as wide as the specimen, so that the traction there is the specimen's own
  // axial stress. Without friction nothing keeps this platen from sliding off sideways under load: guide it in the
  // scene, [zones.platen_top] guided = "y".
  Point(31) = {-o, h,     0, size};
  Point(32) = { o, h,     0, size};
  Point(33) = { o, h + p, 0, size};
  Point(36) = {-o, h + p, 0, size};
  Line(31) = {31, 32};
  Line(32) = {32, 33};
  Line(36) = {36, 31};
  If (platen_overhang_m > 0)
    Point(34) = { w, h + p, 0, size};
    Point(35) = {-w, h + p, 0, size};
    Line(33) = {33, 34};
    Line(34) = {34, 35};
    Line(35) = {35, 36};
    Curve Loop(3) = {31, 32, 33, 34, 35, 36};
  Else
    Line(34) = {33, 36};
    Curve Loop(3) = {31, 32, 34, 36};
  EndIf
  Plane Surface(3) = {3};
  Physical Surface("platen_top") = {3};
  Physical Curve("load:top") = {34};
  Physical Curve("contact:top") = {3, 31};
Else
  Physical Curve("load:top") = {3};
EndIf
Physical Curve("crack:flaw") = {11};
