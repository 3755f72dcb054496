// A tunnel in jointed rock, inside a frame that holds the rock around it.
//
// Open this file in Gmsh: the parameters stand in the side panel and the drawing follows them. Metres; the origin is the
// middle of the tunnel's floor-to-roof line at springing height (the centre of its roof).
//
// What geomech reads: "rock" (with the tunnel as a hole) and "frame" are zones; "tunnel:roof", "tunnel:wall",
// "tunnel:floor" name the tunnel's edges; "joint:fault" parts the rock; lines called "bolt:roof" are bolts, whose properties
// the scene gives ([[loads.bolts]]), and points called "monitor:…" are recorded. Joint sets come from the scene.

DefineConstant[
  shape = {1, Choices{0="circle", 1="horseshoe"}, Name "Parameters/1Tunnel/shape", Label "Shape"},
  width_m = {6, Min 0.1, Max 100, Step 0.5, Name "Parameters/1Tunnel/width_m", Label "Width [m]"},
  wall_m = {3, Min 0.1, Max 100, Step 0.5, Name "Parameters/1Tunnel/wall_m", Label "Height of the walls [m]", Visible shape},
  rock_m = {12, Min 0.2, Max 1000, Step 1, Name "Parameters/2Rock/rock_m", Label "Rock on each side of the centre [m]"},
  frame_m = {2, Min 0.01, Max 1000, Step 0.5, Name "Parameters/2Rock/frame_m", Label "Thickness of the frame [m]"},
  fault = {1, Choices{0="none", 1="drawn"}, Name "Parameters/3Fault/fault", Label "Fault"},
  fault_angle_deg = {-58, Min -90, Max 90, Step 1, Name "Parameters/3Fault/fault_angle_deg",
                     Label "From the horizontal [deg]", Visible fault},
  fault_offset_m = {4.3, Min -100, Max 100, Step 0.5, Name "Parameters/3Fault/fault_offset_m",
                    Label "Distance from the centre [m]", Visible fault},
  bolts = {7, Min 0, Max 99, Step 1, Name "Parameters/4Support/bolts", Label "Bolts in the roof"},
  bolt_m = {4, Min 0.1, Max 100, Step 0.5, Name "Parameters/4Support/bolt_m", Label "Their length [m]", Visible bolts},
  bolt_spread_deg = {150, Min 1, Max 180, Step 5, Name "Parameters/4Support/bolt_spread_deg",
                     Label "Angle that they span [deg]", Visible bolts}
];

r = width_m / 2;
b = rock_m;
o = rock_m + frame_m;
size = rock_m / 8;

// The tunnel, counter-clockwise from its right springing
Point(1) = {0, 0, 0, size};
Point(2) = {r, 0, 0, size / 3};
Point(3) = {0, r, 0, size / 3};
Point(4) = {-r, 0, 0, size / 3};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
If (shape == 0)
  Point(5) = {0, -r, 0, size / 3};
  Circle(3) = {4, 1, 5};
  Circle(4) = {5, 1, 2};
  hole[] = {1, 2, 3, 4};
  Physical Curve("tunnel:wall") = {3, 4};
Else
  Point(5) = {-r, -wall_m, 0, size / 3};
  Point(6) = {r, -wall_m, 0, size / 3};
  Line(3) = {4, 5};
  Line(4) = {5, 6};
  Line(5) = {6, 2};
  hole[] = {1, 2, 3, 4, 5};
  Physical Curve("tunnel:wall") = {3, 5};
  Physical Curve("tunnel:floor") = {4};
EndIf
Physical Curve("tunnel:roof") = {1, 2};
Curve Loop(1) = {hole[]};

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

If (fault)
  // A line at its distance from the centre, from rim to rim of the rock
  a = fault_angle_deg * Pi / 180;
  c = Cos(a);
  s = Sin(a);
  x = -s * fault_offset_m;
  y = c * fault_offset_m;
  tx1 = (Fabs(c) > 1e-9) ? (-b - x) / c : -1e9;
  tx2 = (Fabs(c) > 1e-9) ? (b - x) / c : 1e9;
  ty1 = (Fabs(s) > 1e-9) ? (-b - y) / s : -1e9;
  ty2 = (Fabs(s) > 1e-9) ? (b - y) / s : 1e9;
  xl = (tx1 < tx2) ? tx1 : tx2;
  xh = (tx1 < tx2) ? tx2 : tx1;
  yl = (ty1 < ty2) ? ty1 : ty2;
  yh = (ty1 < ty2) ? ty2 : ty1;
  low = (xl > yl) ? xl : yl;
  high = (xh < yh) ? xh : yh;
  Point(31) = {x + low * c, y + low * s, 0, size};
  Point(32) = {x + high * c, y + high * s, 0, size};
  Line(31) = {31, 32};
  Physical Curve("joint:fault") = {31};
EndIf

// Bolts, radially about the crown; they cut nothing
If (bolts > 0)
  bar[] = {};
  gap = 0;
  If (bolts > 1)
    gap = bolt_spread_deg * Pi / 180 / (bolts - 1);
  EndIf
  For i In {1:bolts}
    a = Pi / 2 + (i - (bolts + 1) / 2) * gap;
    Point(100 + 2 * i) = {r * Cos(a), r * Sin(a), 0, size};
    Point(101 + 2 * i) = {(r + bolt_m) * Cos(a), (r + bolt_m) * Sin(a), 0, size};
    Line(100 + i) = {100 + 2 * i, 101 + 2 * i};
    bar[] += {100 + i};
  EndFor
  Physical Curve("bolt:roof") = {bar[]};
EndIf

// Points to record, just inside the rock
Point(41) = {0.02 * r, 1.05 * r, 0, size};
Physical Point("monitor:crown") = {41};
Point(42) = {1.05 * r, -0.02 * r, 0, size};
Physical Point("monitor:springing") = {42};
