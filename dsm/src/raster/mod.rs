//! The CPU rasteriser: colour, depth and labels in one pass.
