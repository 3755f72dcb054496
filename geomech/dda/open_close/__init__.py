"""The open–close iteration: contact states that are consistent with the motion."""
