//! The fitted weights, as `dsm eval grounding --fit FILE` writes them.

use super::kind::COUNT;

/// Weight by kind.
pub(super) const FITTED: [f32; COUNT] = [
    1.269,  // noun
    0.045,  // mentioned
    0.523,  // detection
    0.593,  // volume
    1.09,   // color
    1.016,  // material
    1.496,  // size
    0.973,  // shape
    1.0,    // pattern
    1.064,  // weight
    0.748,  // purpose
    1.233,  // on
    0.571,  // in
    1.066,  // under
    1.049,  // above
    1.198,  // below
    1.484,  // next_to
    1.826,  // near
    1.845,  // far
    1.407,  // against
    0.553,  // with
    1.072,  // between
    1.58,   // closest
    1.797,  // farthest
    1.046,  // side_told
    0.848,  // side_front
    0.694,  // side_center
    0.431,  // side_face
    0.198,  // depth_told
    0.691,  // depth_front
    0.593,  // depth_center
    0.196,  // depth_face
    0.714,  // side_near
    0.868,  // negated
    0.423,  // bounds
    1.0,    // room
    0.395,  // nearest
    -0.068, // farther
    0.686,  // extreme
    1.228,  // length
    0.288,  // height
    0.939,  // row_told
    0.214,  // row_center
    0.124,  // row_face
    0.067,  // middle
    0.381,  // central
    1.18,   // corner
    -1.406, // literal_name
    1.693,  // literal_best
    0.806,  // mention_near
    -0.258, // word_wall
    0.619,  // word_corner
    1.423,  // word_middle
    1.135,  // word_high
    1.36,   // word_low
    0.359,  // word_big
    0.626,  // word_small
    0.164,  // word_long
    0.507,  // word_tall
    0.402,  // word_even
    0.415,  // word_light
    1.236,  // word_dark
    0.601,  // word_hue
    0.726,  // word_end
    1.203,  // word_alone
    0.322,  // word_side
    0.119,  // word_far
    0.154,  // word_entry
];
