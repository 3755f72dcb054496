// A slope with a sliding plane that daylights at its toe, an open tension crack behind the crest, and on the plane one
// bridge of whole rock. Without the bridge it is Hoek & Bray's planar failure (1981, "Rock Slope Engineering", chapter 7).
//
// Open this file in Gmsh: the parameters stand in the side panel. Metres; the origin is the toe; it faces left.
//
// What geomech reads: "rock" is one zone, "base" (what it stands on) another; "crack:plane" is the joint on both sides of
// the bridge, "crack:tension" the tension crack.

DefineConstant[
  height_m = {30, Min 0.1, Max 1000, Step 1, Name "Parameters/1Slope/height_m", Label "Height [m]"},
  face_angle_deg = {60, Min 20, Max 89, Step 5, Name "Parameters/1Slope/face_angle_deg", Label "Angle of the face [deg]"},
  plane_dip_deg = {35, Min 5, Max 80, Step 1, Name "Parameters/2Plane/plane_dip_deg", Label "Dip of the plane [deg]"},
  crack_distance_m = {6, Min 0.1, Max 1000, Step 1, Name "Parameters/2Plane/crack_distance_m",
                      Label "Tension crack behind the crest [m]"},
  bridge_m = {1, Min 1e-3, Max 1000, Step 0.1, Name "Parameters/3Bridge/bridge_m", Label "Length of the bridge [m]"},
  bridge_at = {0.4, Min 0.01, Max 0.99, Step 0.05, Name "Parameters/3Bridge/bridge_at",
               Label "Its middle, in parts of the plane from the toe"}
];

cot = 1 / Tan(face_angle_deg * Pi / 180);
c = Cos(plane_dip_deg * Pi / 180);
s = Sin(plane_dip_deg * Pi / 180);
brink = height_m * cot;
x1 = brink + crack_distance_m;      // where the plane meets the tension crack
plane = x1 / c;                     // its length
front = -height_m / 2;
back = 2 * x1;
below = front - back;               // as deep as wide: how the base presses is not felt at the plane
size = height_m / 8;

Point(1) = {0, 0, 0, size};
Point(2) = {front, 0, 0, size};
Point(3) = {front, below, 0, size};
Point(4) = {back, below, 0, size};
Point(5) = {back, height_m, 0, size};
Point(6) = {x1, height_m, 0, size};
Point(7) = {brink, height_m, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 7};
Line(7) = {7, 1};
Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7};
Plane Surface(1) = {1};
Point(8) = {front, below - height_m / 4, 0, size};
Point(9) = {back, below - height_m / 4, 0, size};
Line(8) = {3, 8};
Line(9) = {8, 9};
Line(10) = {9, 4};
Curve Loop(2) = {8, 9, 10, -3};
Plane Surface(2) = {2};
Physical Surface("rock") = {1};
Physical Surface("base") = {2};

r0 = bridge_at * plane - bridge_m / 2;
r1 = bridge_at * plane + bridge_m / 2;
Point(11) = {r0 * c, r0 * s, 0, size};
Point(12) = {r1 * c, r1 * s, 0, size};
Point(13) = {plane * c, plane * s, 0, size};
Line(11) = {1, 11};
Line(12) = {12, 13};
Physical Curve("crack:plane") = {11, 12};
Line(13) = {13, 6};
Physical Curve("crack:tension") = {13};
