// A semicircular arch of voussoirs on two springings.
//
// The thinnest that stands under its own weight is 0.1075 of its mean radius thick (Milankovitch 1907). Open this file in
// Gmsh: the parameters stand in the side panel. Metres; the origin is the centre of the arch.
//
// What geomech reads: "voussoirs" is a zone of many surfaces, one block each, "springings" hold them; "joint:radial" are the
// beds between them, "extrados" and "intrados" name their other edges.

DefineConstant[
  voussoirs = {17, Min 3, Max 200, Step 2, Name "Parameters/1Arch/voussoirs", Label "Number of voussoirs"},
  radius_m = {10, Min 0.01, Max 1000, Step 1, Name "Parameters/1Arch/radius_m", Label "Mean radius [m]"},
  thickness_ratio = {0.15, Min 0.01, Max 1, Step 0.01, Name "Parameters/1Arch/thickness_ratio",
                     Label "Thickness over mean radius"},
  half_angle_deg = {90, Min 20, Max 90, Step 5, Name "Parameters/1Arch/half_angle_deg",
                    Label "Half of the opening angle [deg]"},
  springing_m = {2, Min 0.01, Max 100, Step 0.5, Name "Parameters/2Springings/springing_m", Label "Depth [m]"}
];

ri = radius_m * (1 - thickness_ratio / 2);
ro = radius_m * (1 + thickness_ratio / 2);
h = half_angle_deg * Pi / 180;
size = radius_m * thickness_ratio;
beds[] = {};
inner[] = {};
outer[] = {};
For i In {1:voussoirs}
  a = Pi / 2 - h + 2 * h * (i - 1) / voussoirs;
  b = Pi / 2 - h + 2 * h * i / voussoirs;
  p = 4 * i;
  Point(p) = {ri * Cos(a), ri * Sin(a), 0, size};
  Point(p + 1) = {ro * Cos(a), ro * Sin(a), 0, size};
  Point(p + 2) = {ro * Cos(b), ro * Sin(b), 0, size};
  Point(p + 3) = {ri * Cos(b), ri * Sin(b), 0, size};
  Line(p) = {p, p + 1};
  Line(p + 1) = {p + 1, p + 2};
  Line(p + 2) = {p + 2, p + 3};
  Line(p + 3) = {p + 3, p};
  Curve Loop(i) = {p, p + 1, p + 2, p + 3};
  Plane Surface(i) = {i};
  beds[] += {p, p + 2};
  outer[] += {p + 1};
  inner[] += {p + 3};
EndFor
Physical Surface("voussoirs") = {1:voussoirs};

// The springings stand under the first bed and the last, at right angles to them.
For side In {0:1}
  a = (side == 0) ? Pi / 2 - h : Pi / 2 + h;
  sign = (side == 0) ? 1 : -1;
  p = 2000 + 10 * side;
  Point(p) = {ri * Cos(a), ri * Sin(a), 0, size};
  Point(p + 1) = {ro * Cos(a), ro * Sin(a), 0, size};
  Point(p + 2) = {ro * Cos(a) + sign * springing_m * Sin(a), ro * Sin(a) - sign * springing_m * Cos(a), 0, size};
  Point(p + 3) = {ri * Cos(a) + sign * springing_m * Sin(a), ri * Sin(a) - sign * springing_m * Cos(a), 0, size};
  Line(p) = {p, p + 1};
  Line(p + 1) = {p + 1, p + 2};
  Line(p + 2) = {p + 2, p + 3};
  Line(p + 3) = {p + 3, p};
  Curve Loop(p) = {p, p + 1, p + 2, p + 3};
  Plane Surface(p) = {p};
  beds[] += {p};
EndFor
Physical Surface("springings") = {2000, 2010};
Physical Curve("joint:radial") = {beds[]};
Physical Curve("extrados") = {outer[]};
Physical Curve("intrados") = {inner[]};
