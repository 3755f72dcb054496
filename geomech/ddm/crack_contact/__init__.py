"""Contact of crack faces: unilateral, frictional, cemented or filled."""
