// A slope cut by two joint sets that do not run through: rock bridges hold it, until cracks grow across them.
//
// Open this file in Gmsh: the parameters stand in the side panel and the drawing follows them. Metres; the origin is the
// toe; the slope faces left. The joints are drawn here, line by line: traces of one length with rock between them.
//
// What geomech reads: "rock" and "base" are zones; "joint:bedding" and "joint:steep" part the rock, their ends in rock
// become cracks before rock bridges; "slope", "crest", "back" name edges.

DefineConstant[
  height_m = {20, Min 0.1, Max 1000, Step 1, Name "Parameters/1Slope/height_m", Label "Height [m]"},
  face_angle_deg = {65, Min 20, Max 89, Step 5, Name "Parameters/1Slope/face_angle_deg", Label "Angle of the face [deg]"},
  crest_width_m = {20, Min 1, Max 1000, Step 1, Name "Parameters/1Slope/crest_width_m", Label "Behind the crest [m]"},
  base_m = {4, Min 0.1, Max 1000, Step 1, Name "Parameters/1Slope/base_m", Label "Thickness of the base [m]"},
  dip_a_deg = {30, Min 0, Max 60, Step 5, Name "Parameters/2Bedding/dip_a_deg", Label "Dip out of the slope [deg]"},
  spacing_a_m = {3.5, Min 0.1, Max 100, Step 0.5, Name "Parameters/2Bedding/spacing_a_m", Label "Spacing [m]"},
  length_a_m = {14, Min 0.1, Max 1000, Step 1, Name "Parameters/2Bedding/length_a_m", Label "Length of a trace [m]"},
  bridge_a_m = {1.2, Min 0, Max 100, Step 0.5, Name "Parameters/2Bedding/bridge_a_m", Label "Rock between traces [m]"},
  angle_b_deg = {100, Min 60, Max 150, Step 5, Name "Parameters/3Steep set/angle_b_deg", Label "From the horizontal [deg]"},
  spacing_b_m = {4.5, Min 0.1, Max 100, Step 0.5, Name "Parameters/3Steep set/spacing_b_m", Label "Spacing [m]"},
  length_b_m = {9, Min 0.1, Max 1000, Step 1, Name "Parameters/3Steep set/length_b_m", Label "Length of a trace [m]"},
  bridge_b_m = {1.5, Min 0, Max 100, Step 0.5, Name "Parameters/3Steep set/bridge_b_m", Label "Rock between traces [m]"}
];

brink = height_m / Tan(face_angle_deg * Pi / 180);
back = brink + crest_width_m;
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
Point(5) = {-0.3 * height_m, -base_m, 0, size};
Point(6) = {back + base_m, -base_m, 0, size};
Point(8) = {back + base_m, height_m, 0, size};
Point(7) = {-0.3 * height_m, 0, 0, size};
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

// Both sets over the whole box: what lies outside the rock is left out when it is cut. Every other line begins half a
// trace further on, so that bridges do not stand side by side. The first lines keep off the corners of the rock.
reach = Hypot(back, height_m);
beds[] = {};
steep[] = {};
np = 1000;
For set In {0:1}
  If (set == 0)
    a = dip_a_deg * Pi / 180; s = spacing_a_m; l = length_a_m; g = bridge_a_m;
  Else
    a = angle_b_deg * Pi / 180; s = spacing_b_m; l = length_b_m; g = bridge_b_m;
  EndIf
  c = Cos(a);
  n = Sin(a);
  For i In {-Ceil(reach / s):Ceil(reach / s)}
    shift = (i - 2 * Floor(i / 2)) * 0.5 * (l + g);
    For j In {-Ceil(reach / (l + g)) - 1:Ceil(reach / (l + g))}
      // Middle of the box plus so much across and along
      x = 0.5 * back - n * (i + 0.37) * s + c * (j * (l + g) + shift);
      y = 0.5 * height_m + c * (i + 0.37) * s + n * (j * (l + g) + shift);
      mx = x + 0.5 * l * c;
      my = y + 0.5 * l * n;
      // Traces that are far from the rock are not drawn at all.
      If (mx > -0.5 * l && mx < back + 0.5 * l && my > -0.5 * l && my < height_m + 0.5 * l)
        If (my * brink < height_m * (mx + 0.5 * l) && y + l * n > 0.1 * s)
          // The base stays whole: a trace that would reach into it starts or ends on it.
          from = (y < 0) ? -y / n : 0;
          to = l;
          If (Fabs(c) > 1e-9)
            at = (back - x) / c;
            to = (c > 0 && at < to) ? at : to;
            from = (c < 0 && at > from) ? at : from;
          EndIf
          If (to - from > 0.01 * l)
            Point(np) = {x + from * c, y + from * n, 0, size};
            Point(np + 1) = {x + to * c, y + to * n, 0, size};
            Line(np) = {np, np + 1};
            If (set == 0)
              beds[] += {np};
            Else
              steep[] += {np};
            EndIf
            np = np + 2;
          EndIf
        EndIf
      EndIf
    EndFor
  EndFor
EndFor
Physical Curve("joint:bedding") = {beds[]};
Physical Curve("joint:steep") = {steep[]};
