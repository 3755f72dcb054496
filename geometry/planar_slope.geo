// A slope with a sliding plane that daylights in its face, and a tension crack behind (or in front of) the crest.
//
// Hoek & Bray (1981), "Rock Slope Engineering", chapter 7: height, face angle, dip of the plane, depth of the tension
// crack. Open this file in Gmsh: the parameters stand in the side panel. Metres; the origin is the toe; it faces left.
//
// What geomech reads: "rock" is one zone, "base" (below the toe) another; "joint:plane" and "joint:tension" part the rock;
// "slope" and "crest" name edges.

DefineConstant[
  height_m = {30, Min 0.1, Max 1000, Step 1, Name "Parameters/1Slope/height_m", Label "Height [m]"},
  face_angle_deg = {60, Min 20, Max 89, Step 5, Name "Parameters/1Slope/face_angle_deg", Label "Angle of the face [deg]"},
  crest_width_m = {40, Min 1, Max 1000, Step 1, Name "Parameters/1Slope/crest_width_m", Label "Behind the crest [m]"},
  base_m = {6, Min 0.1, Max 1000, Step 1, Name "Parameters/1Slope/base_m", Label "Thickness of the base [m]"},
  plane_dip_deg = {35, Min 5, Max 80, Step 1, Name "Parameters/2Plane/plane_dip_deg", Label "Dip of the plane [deg]"},
  toe_height_m = {0, Min 0, Max 1000, Step 1, Name "Parameters/2Plane/toe_height_m",
                  Label "Height at which it daylights [m]"},
  tension_crack = {1, Choices{0="none", 1="behind the crest"}, Name "Parameters/3Tension crack/tension_crack",
                   Label "Tension crack"},
  crack_distance_m = {6, Min 0, Max 1000, Step 1, Name "Parameters/3Tension crack/crack_distance_m",
                      Label "Distance from the crest [m]", Visible tension_crack}
];

cot = 1 / Tan(face_angle_deg * Pi / 180);
d = plane_dip_deg * Pi / 180;
brink = height_m * cot;
back = brink + crest_width_m;
x0 = toe_height_m * cot;   // where the plane leaves the face
size = height_m / 8;
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
Point(5) = {-0.4 * height_m, -base_m, 0, size};
Point(6) = {back + base_m, -base_m, 0, size};
Point(8) = {back + base_m, height_m, 0, size};
Point(7) = {-0.4 * height_m, 0, 0, size};
Line(5) = {5, 6};
Line(6) = {6, 8};
Line(9) = {8, 3};
Line(7) = {1, 7};
Line(8) = {7, 5};
Curve Loop(2) = {5, 6, 9, -2, -1, 7, 8};
Plane Surface(2) = {2};
Physical Surface("rock") = {1};
Physical Surface("base") = {2};
Physical Curve("slope") = {4};
Physical Curve("crest") = {3};
Physical Curve("back") = {2};

// The plane ends at the tension crack, or at the crest or the back, whichever it meets first.
x1 = x0 + (height_m - toe_height_m) / Tan(d);
If (tension_crack)
  x1 = (brink + crack_distance_m < x1) ? brink + crack_distance_m : x1;
Else
  x1 = (back < x1) ? back : x1;
EndIf
Point(11) = {x0, toe_height_m, 0, size};
Point(12) = {x1, toe_height_m + (x1 - x0) * Tan(d), 0, size};
Line(11) = {11, 12};
Physical Curve("joint:plane") = {11};
If (tension_crack)
  Point(13) = {x1, height_m, 0, size};
  Line(12) = {12, 13};
  Physical Curve("joint:tension") = {12};
EndIf
