// A slope in benches, as in an open pit, with a bedding plane daylighting in its face.
//
// Open this file in Gmsh: the parameters stand in the side panel and the drawing follows them. A scene sets them with
//     [geometry]
//     model = "benched_slope.geo"
//     parameters = { benches = 4, face_angle_deg = 75 }
// using the last part of each name. Metres; the origin is the toe of the lowest bench; the slope faces left.
//
// What geomech reads: physical surfaces are zones ("rock", "base"); physical curves called "joint:…" inside them part the
// rock; "slope", "crest" and the sides name edges; the line called "water" is the water table where the scene has [loads.water],
// points called "monitor:…" are recorded. Joint sets come from the scene, [[geometry.joint_sets]].

DefineConstant[
  benches = {3, Min 1, Max 12, Step 1, Name "Parameters/1Slope/benches", Label "Number of benches"},
  bench_height_m = {10, Min 0.1, Max 100, Step 1, Name "Parameters/1Slope/bench_height_m", Label "Height of a bench [m]"},
  berm_width_m = {6, Min 0.1, Max 100, Step 1, Name "Parameters/1Slope/berm_width_m", Label "Width of a berm [m]"},
  face_angle_deg = {70, Min 20, Max 89, Step 5, Name "Parameters/1Slope/face_angle_deg", Label "Angle of the faces [deg]"},
  crest_width_m = {25, Min 1, Max 1000, Step 5, Name "Parameters/2Rock/crest_width_m", Label "Behind the crest [m]"},
  floor_width_m = {12, Min 1, Max 1000, Step 2, Name "Parameters/2Rock/floor_width_m", Label "Before the toe [m]"},
  base_m = {6, Min 0.1, Max 1000, Step 1, Name "Parameters/2Rock/base_m", Label "Thickness of the base [m]"},
  fault = {1, Choices{0="none", 1="through the toe"}, Name "Parameters/3Fault/fault", Label "Fault"},
  fault_dip_deg = {32, Min 5, Max 80, Step 1, Name "Parameters/3Fault/fault_dip_deg", Label "Its dip out of the slope [deg]",
                   Visible fault},
  water = {1, Choices{0="none", 1="drawn"}, Name "Parameters/4Water/water", Label "Water table"},
  water_share = {0.35, Min 0, Max 1, Step 0.05, Name "Parameters/4Water/water_share",
                 Label "Its level at the back, of the height", Visible water}
];

run = bench_height_m / Tan(face_angle_deg * Pi / 180);
top = benches * bench_height_m;
brink = benches * run + (benches - 1) * berm_width_m;
back = brink + crest_width_m;
size = bench_height_m / 3;

// The face, from the toe up
k = 0;
Point(1) = {0, 0, 0, size};
face[] = {};
For i In {1:benches}
  x = (i - 1) * (run + berm_width_m) + run;
  Point(2 * i) = {x, i * bench_height_m, 0, size};
  Line(2 * i - 1) = {2 * i - 1, 2 * i};
  face[] += {2 * i - 1};
  If (i < benches)
    Point(2 * i + 1) = {x + berm_width_m, i * bench_height_m, 0, size};
    Line(2 * i) = {2 * i, 2 * i + 1};
    face[] += {2 * i};
  EndIf
EndFor
Point(101) = {back, top, 0, size};
Point(102) = {back, 0, 0, size};
Line(101) = {2 * benches, 101};
Line(102) = {101, 102};
Line(103) = {102, 1};
Curve Loop(1) = {face[], 101, 102, 103};
Plane Surface(1) = {1};

// The base that holds it, before the toe and behind the rock too
Point(111) = {-floor_width_m, -base_m, 0, size};
Point(112) = {back + base_m, -base_m, 0, size};
Point(113) = {-floor_width_m, 0, 0, size};
Point(114) = {back + base_m, top, 0, size};
Line(111) = {111, 112};
Line(112) = {112, 114};
Line(115) = {114, 101};
Line(113) = {1, 113};
Line(114) = {113, 111};
Curve Loop(2) = {111, 112, 115, 102, 103, 113, 114};
Plane Surface(2) = {2};

Physical Surface("rock") = {1};
Physical Surface("base") = {2};
Physical Curve("slope") = {face[]};
Physical Curve("crest") = {101};
Physical Curve("back") = {102};

If (fault)
  // From the toe to the crest or to the back, whichever it meets first; the model keeps the piece inside.
  d = fault_dip_deg * Pi / 180;
  If (back * Tan(d) < top)
    Point(121) = {back, back * Tan(d), 0, size};
  Else
    Point(121) = {top / Tan(d), top, 0, size};
  EndIf
  Line(121) = {1, 121};
  Physical Curve("joint:fault") = {121};
EndIf

If (water)
  // It leaves the rock at the toe and rises to the back as the free surface of a drained slope does, with the square root
  h = water_share * top;
  wet[] = {};
  Point(131) = {-floor_width_m, 0, 0, size};
  For i In {0:8}
    Point(132 + i) = {i / 8 * (back + base_m), h * Sqrt(i / 8), 0, size};
    Line(131 + i) = {131 + i, 132 + i};
    wet[] += {131 + i};
  EndFor
  Physical Curve("water") = {wet[]};
EndIf

// Points to record: behind the brink of each bench
For i In {1:benches}
  Point(150 + i) = {(i - 1) * (run + berm_width_m) + run + 0.1 * berm_width_m, i * bench_height_m - 0.02 * bench_height_m, 0, size};
  Physical Point(Sprintf("monitor:bench %g", i)) = {150 + i};
EndFor
