"""The 6×6-block system of a step, and its direct solution by nested dissection and dense fronts."""
