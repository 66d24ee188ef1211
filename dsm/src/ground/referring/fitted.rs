//! The fitted weights, as `dsm eval grounding --fit FILE` writes them.

use super::kind::COUNT;

/// Weight by kind.
pub(super) const FITTED: [f32; COUNT] = [
    1.272,  // noun
    0.054,  // mentioned
    0.523,  // detection
    0.591,  // volume
    1.093,  // color
    1.017,  // material
    1.495,  // size
    0.972,  // shape
    1.0,    // pattern
    1.064,  // weight
    0.748,  // purpose
    1.234,  // on
    0.57,   // in
    1.072,  // under
    1.052,  // above
    1.199,  // below
    1.486,  // next_to
    1.825,  // near
    1.842,  // far
    1.408,  // against
    0.553,  // with
    1.153,  // between
    1.569,  // closest
    1.8,    // farthest
    1.047,  // side_told
    0.849,  // side_front
    0.694,  // side_center
    0.431,  // side_face
    0.199,  // depth_told
    0.693,  // depth_front
    0.593,  // depth_center
    0.198,  // depth_face
    0.713,  // side_near
    0.868,  // negated
    0.425,  // bounds
    1.0,    // room
    0.395,  // nearest
    -0.069, // farther
    0.686,  // extreme
    1.228,  // length
    0.286,  // height
    0.939,  // row_told
    0.214,  // row_center
    0.124,  // row_face
    0.066,  // middle
    0.381,  // central
    1.177,  // corner
    -1.674, // literal_name
    1.664,  // literal_best
    0.807,  // mention_near
    -0.261, // word_wall
    0.622,  // word_corner
    1.421,  // word_middle
    1.143,  // word_high
    1.364,  // word_low
    0.36,   // word_big
    0.624,  // word_small
    0.165,  // word_long
    0.509,  // word_tall
    0.4,    // word_even
    0.413,  // word_light
    1.238,  // word_dark
    0.6,    // word_hue
    0.726,  // word_end
    1.203,  // word_alone
    0.324,  // word_side
    0.119,  // word_far
    0.16,   // word_entry
];
