// A Brazilian disc with a crack at its centre, between two platens; flats where the platens press (Wang, Jia, Kou, Zhang &
// Lindqvist 2004, "The flattened Brazilian disc specimen used for testing elastic modulus, tensile strength and fracture
// toughness of brittle rocks", International Journal of Rock Mechanics and Mining Sciences 41, 245-253).
//
// Open this file in Gmsh: the parameters stand in the side panel. Metres; the origin is the centre of the disc.
//
// What geomech reads: "disc", "platen_bottom", "platen_top" are zones; "crack:notch" is a crack; "contact:top",
// "contact:bottom" are the faces between disc and platens, "load:top" is the upper platen's back.

DefineConstant[
  radius_m = {0.05, Min 0.001, Max 10, Step 0.005, Name "Parameters/1Disc/radius_m", Label "Radius [m]"},
  flat_angle_deg = {20, Min 1, Max 90, Step 5, Name "Parameters/1Disc/flat_angle_deg",
                    Label "Angle that a flat takes, from the centre [deg]"},
  crack_ratio = {0.3, Min 0, Max 0.9, Step 0.05, Name "Parameters/2Crack/crack_ratio",
                 Label "Length of the crack over the diameter (0: none)"},
  crack_angle_deg = {60, Min 0, Max 180, Step 5, Name "Parameters/2Crack/crack_angle_deg",
                     Label "Crack from the horizontal [deg]"},
  platen_height_m = {0.01, Min 0.0001, Max 10, Step 0.005, Name "Parameters/3Platens/platen_height_m", Label "Height [m]"}
];

f = flat_angle_deg * Pi / 360;
r = radius_m;
x = r * Sin(f);
y = r * Cos(f);
size = r / 8;
Point(1) = {0, 0, 0, size};
Point(2) = {x, -y, 0, size / 2};
Point(3) = {r, 0, 0, size};
Point(4) = {x, y, 0, size / 2};
Point(5) = {-x, y, 0, size / 2};
Point(6) = {-r, 0, 0, size};
Point(7) = {-x, -y, 0, size / 2};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Line(3) = {4, 5};
Circle(4) = {5, 1, 6};
Circle(5) = {6, 1, 7};
Line(6) = {7, 2};
Curve Loop(1) = {1, 2, 3, 4, 5, 6};
Plane Surface(1) = {1};
Physical Surface("disc") = {1};

If (crack_ratio > 0)
  a = crack_angle_deg * Pi / 180;
  b = crack_ratio * r;
  Point(11) = {-b * Cos(a), -b * Sin(a), 0, size / 4};
  Point(12) = {b * Cos(a), b * Sin(a), 0, size / 4};
  Line(11) = {11, 12};
  Line{11} In Surface{1};
  Physical Curve("crack:notch") = {11};
EndIf

// Platens own their points, and are half as wide again as the flats.
w = 1.5 * x;
For side In {0:1}
  sign = (side == 0) ? -1 : 1;
  p = 20 + 10 * side;
  Point(p) = {-w, sign * y, 0, size};
  Point(p + 1) = {w, sign * y, 0, size};
  Point(p + 2) = {w, sign * (y + platen_height_m), 0, size};
  Point(p + 3) = {-w, sign * (y + platen_height_m), 0, size};
  Line(p) = {p, p + 1};
  Line(p + 1) = {p + 1, p + 2};
  Line(p + 2) = {p + 2, p + 3};
  Line(p + 3) = {p + 3, p};
  Curve Loop(2 + side) = {p, p + 1, p + 2, p + 3};
  Plane Surface(2 + side) = {2 + side};
EndFor
Physical Surface("platen_bottom") = {2};
Physical Surface("platen_top") = {3};
Physical Curve("contact:bottom") = {6, 20};
Physical Curve("contact:top") = {3, 30};
Physical Curve("load:top") = {32};
