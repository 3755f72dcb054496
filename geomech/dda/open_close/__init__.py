"""Contact states and motion that agree with each other: the open–close iteration."""
