//! What speaks for a candidate, by kind: each kind has one weight.

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal, $start:literal;)*) => {
        /// A kind of evidence.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub(in crate::ground) enum Kind { $($(#[$doc])* $kind,)* }

        /// Number of kinds.
        pub(in crate::ground) const COUNT: usize = [$($name),*].len();

        /// Names of the kinds, in order.
        pub(in crate::ground) const NAMES: [&str; COUNT] = [$($name),*];

        /// Weights that nothing was fitted for: 1 for what the words say, 0 for other readings of them.
        pub(in crate::ground) const UNFITTED: [f32; COUNT] = [$($start),*];
    };
}

kinds! {
    /// Fit of the name.
    Noun = "noun", 1.0;
    /// Only mentioned, not what the words name.
    Mentioned = "mentioned", -6.0;
    /// Score of a detection.
    Detection = "detection", 0.0;
    /// Size beside its peers.
    Volume = "volume", 0.0;
    /// Colour.
    Color = "color", 1.0;
    /// Material.
    Material = "material", 1.0;
    /// Size words.
    Size = "size", 1.0;
    /// Shape.
    Shape = "shape", 1.0;
    /// Pattern.
    Pattern = "pattern", 1.0;
    /// Weight.
    Weight = "weight", 1.0;
    /// Purpose.
    Purpose = "purpose", 1.0;
    /// On.
    On = "on", 1.0;
    /// In.
    In = "in", 1.0;
    /// Under.
    Under = "under", 1.0;
    /// Above.
    Above = "above", 1.0;
    /// Below.
    Below = "below", 1.0;
    /// Next to.
    NextTo = "next_to", 1.0;
    /// Near.
    Near = "near", 1.0;
    /// Far from.
    Far = "far", 1.0;
    /// Against.
    Against = "against", 1.0;
    /// With.
    With = "with", 1.0;
    /// Between.
    Between = "between", 1.0;
    /// Closest to.
    Closest = "closest", 1.0;
    /// Farthest from.
    Farthest = "farthest", 1.0;
    /// Left or right for a viewer whose stand is told.
    SideTold = "side_told", 1.0;
    /// Left or right for one who faces the anchor's known front.
    SideFront = "side_front", 1.0;
    /// Left or right for one in the middle of the scene.
    SideCenter = "side_center", 1.0;
    /// Left or right for one who faces the anchor's likeliest face; another reading.
    SideFace = "side_face", 0.0;
    /// In front or behind, told.
    DepthTold = "depth_told", 1.0;
    /// In front or behind, by the known front.
    DepthFront = "depth_front", 1.0;
    /// In front or behind, from the middle.
    DepthCenter = "depth_center", 1.0;
    /// In front or behind, by the likeliest face; another reading.
    DepthFace = "depth_face", 0.0;
    /// Only near what it is said to be beside; another reading of sides and depths.
    SideNear = "side_near", 0.0;
    /// What must not hold.
    Negated = "negated", 1.0;
    /// Walls, floor and ceiling.
    Bounds = "bounds", 1.0;
    /// Rooms.
    Room = "room", 1.0;
    /// Nearest to the viewer.
    Nearest = "nearest", 1.0;
    /// Farthest from the viewer.
    Farther = "farther", 1.0;
    /// Largest or smallest.
    Extreme = "extreme", 1.0;
    /// Tallest or shortest, longest.
    Length = "length", 1.0;
    /// Highest or lowest.
    Height = "height", 1.0;
    /// Leftmost or rightmost, told.
    RowTold = "row_told", 1.0;
    /// Leftmost or rightmost from the middle.
    RowCenter = "row_center", 1.0;
    /// Leftmost or rightmost for one who faces the row; another reading.
    RowFace = "row_face", 0.0;
    /// In the middle of its peers.
    Middle = "middle", 1.0;
    /// In the middle of the scene.
    Central = "central", 1.0;
    /// In a corner.
    Corner = "corner", 1.0;
    /// Bears another name than the one that fits best, where one relation is all that is said.
    LiteralName = "literal_name", -2.0;
    /// The best at the one relation that is all that is said.
    LiteralBest = "literal_best", 1.0;
    /// Near things that are mentioned but stand in no relation that was read.
    MentionNear = "mention_near", 0.0;
    /// "wall" is said: near a side of the scene.
    WordWall = "word_wall", 0.0;
    /// "corner" is said: near a corner.
    WordCorner = "word_corner", 0.0;
    /// "middle", "center" are said.
    WordMiddle = "word_middle", 0.0;
    /// "top", "upper", "above" are said.
    WordHigh = "word_high", 0.0;
    /// "bottom", "lower", "floor" are said.
    WordLow = "word_low", 0.0;
    /// "large", "big" are said.
    WordBig = "word_big", 0.0;
    /// "small", "little" are said.
    WordSmall = "word_small", 0.0;
    /// "long", "wide" are said.
    WordLong = "word_long", 0.0;
    /// "tall", "high" are said.
    WordTall = "word_tall", 0.0;
    /// "round", "square" are said: as wide as deep.
    WordEven = "word_even", 0.0;
    /// "white", "light" are said: lighter than its peers.
    WordLight = "word_light", 0.0;
    /// "black", "dark" are said: darker than its peers.
    WordDark = "word_dark", 0.0;
    /// A hue is said: more of it than its peers.
    WordHue = "word_hue", 0.0;
    /// "end", "head" of something are said: at an end of the long thing it is beside.
    WordEnd = "word_end", 0.0;
    /// "alone", "itself" are said: far from its peers.
    WordAlone = "word_alone", 0.0;
    /// "left" or "right" are said in no relation that was read.
    WordSide = "word_side", 0.0;
    /// "far", "back", "end" are said: far from the door.
    WordFar = "word_far", 0.0;
    /// "entrance", "door", "enter" are said: near the door.
    WordEntry = "word_entry", 0.0;
}
