// A slope with a row of en-echelon joints from its toe to its crest: where rock between their ends breaks, a stepped path.
//
// Einstein, Veneziano, Baecher & O'Reilly (1983), "The effect of discontinuity persistence on rock slope stability", Int. J.
// Rock Mech. Min. Sci. 20, 227-236: joints of one dip, bridges of rock in and out of their planes.
//
// Open this file in Gmsh: the parameters stand in the side panel. Metres; the origin is the toe; it faces left. The height
// follows from the joints: the last one ends in the ground behind the crest.
//
// What geomech reads: "rock" is one zone, "base" (what it stands on) another; "crack:joint" are the joints.

DefineConstant[
  joints = {10, Min 1, Max 100, Step 1, Name "Parameters/1Joints/joints", Label "Number"},
  joint_dip_deg = {40, Min 5, Max 80, Step 1, Name "Parameters/1Joints/joint_dip_deg", Label "Dip [deg]"},
  joint_length_m = {3, Min 0.01, Max 100, Step 0.1, Name "Parameters/1Joints/joint_length_m", Label "Length [m]"},
  step_m = {0.5, Min 1e-3, Max 100, Step 0.1, Name "Parameters/2Bridges/step_m",
            Label "Distance between neighbours, across their dip [m]"},
  overlap_m = {0, Min -100, Max 100, Step 0.1, Name "Parameters/2Bridges/overlap_m", Label "Overlap, along their dip [m]"},
  face_angle_deg = {70, Min 20, Max 89, Step 5, Name "Parameters/3Slope/face_angle_deg", Label "Angle of the face [deg]"}
];

c = Cos(joint_dip_deg * Pi / 180);
s = Sin(joint_dip_deg * Pi / 180);
along = joint_length_m - overlap_m;
dx = along * c - step_m * s;        // from joint to joint
dy = along * s + step_m * c;
height = (joints - 1) * dy + joint_length_m * s;
top = (joints - 1) * dx + joint_length_m * c;
brink = height / Tan(face_angle_deg * Pi / 180);
front = -height / 2;
back = 2 * top;
below = front - back;                 // as deep as wide: how the base presses is not felt at the joints
size = height / 8;

Point(1) = {0, 0, 0, size};
Point(2) = {front, 0, 0, size};
Point(3) = {front, below, 0, size};
Point(4) = {back, below, 0, size};
Point(5) = {back, height, 0, size};
Point(6) = {top, height, 0, size};
Point(7) = {brink, height, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 6};
Line(6) = {6, 7};
Line(7) = {7, 1};
Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7};
Plane Surface(1) = {1};
Point(8) = {front, below - height / 4, 0, size};
Point(9) = {back, below - height / 4, 0, size};
Line(8) = {3, 8};
Line(9) = {8, 9};
Line(10) = {9, 4};
Curve Loop(2) = {8, 9, 10, -3};
Plane Surface(2) = {2};
Physical Surface("rock") = {1};
Physical Surface("base") = {2};

For k In {0 : joints - 1}
  start = 100 + 2 * k;
  If (k == 0)
    start = 1;
  Else
    Point(start) = {k * dx, k * dy, 0, size};
  EndIf
  end = 101 + 2 * k;
  If (k == joints - 1)
    end = 6;
  Else
    Point(end) = {k * dx + joint_length_m * c, k * dy + joint_length_m * s, 0, size};
  EndIf
  Line(100 + k) = {start, end};
  Physical Curve(Sprintf("crack:joint%g", k + 1)) = {100 + k};
EndFor
