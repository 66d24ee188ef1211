//! The stages of one map update, named for those who measure them.

/// A stage of [`super::MapBuilder::observe`], in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// From masks to clean points, features and attributes.
    CleanPoints,
    /// Which observation shows which object; laying the frame onto the map is part of it.
    Associate,
    /// Fusion into the sliding windows, and the shapes read off them.
    Window,
    /// Duplicates, what is gone, what was never confirmed.
    CleanUp,
    /// Free space from depth.
    Occupancy,
    /// Division into rooms, when it is due.
    Rooms,
    /// Relations around what changed.
    Relations,
}

impl Stage {
    /// All stages in their order.
    pub const ALL: [Self; 7] = [
        Self::CleanPoints,
        Self::Associate,
        Self::Window,
        Self::CleanUp,
        Self::Occupancy,
        Self::Rooms,
        Self::Relations,
    ];

    /// A short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::CleanPoints => "clean_points",
            Self::Associate => "associate",
            Self::Window => "window",
            Self::CleanUp => "clean_up",
            Self::Occupancy => "occupancy",
            Self::Rooms => "rooms",
            Self::Relations => "relations",
        }
    }
}
