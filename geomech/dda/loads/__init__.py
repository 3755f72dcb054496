"""What acts on blocks besides contacts: forces, water, bolts, prescribed motion, viscous edges."""
