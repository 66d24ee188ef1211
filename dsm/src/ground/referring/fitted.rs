//! The fitted weights, as `dsm eval grounding --fit FILE` writes them.

use super::kind::COUNT;

/// Weight by kind.
pub(super) const FITTED: [f32; COUNT] = [
    1.309,  // noun
    -1.237, // mentioned
    0.535,  // detection
    0.61,   // volume
    1.001,  // color
    1.156,  // material
    1.522,  // size
    1.024,  // shape
    1.0,    // pattern
    1.072,  // weight
    0.747,  // purpose
    1.194,  // on
    0.538,  // in
    1.06,   // under
    1.076,  // above
    1.215,  // below
    1.521,  // next_to
    1.783,  // near
    1.839,  // far
    1.377,  // against
    0.586,  // with
    1.085,  // between
    1.606,  // closest
    1.793,  // farthest
    0.985,  // side_told
    0.843,  // side_front
    0.663,  // side_center
    0.441,  // side_face
    0.427,  // depth_told
    0.618,  // depth_front
    0.595,  // depth_center
    0.263,  // depth_face
    0.729,  // side_near
    0.885,  // negated
    0.457,  // bounds
    1.0,    // room
    0.395,  // nearest
    0.041,  // farther
    0.686,  // extreme
    1.298,  // length
    0.269,  // height
    1.054,  // row_told
    0.212,  // row_center
    0.121,  // row_face
    0.213,  // middle
    0.386,  // central
    1.195,  // corner
    -1.53,  // literal_name
    1.714,  // literal_best
    0.873,  // mention_near
    -0.284, // word_wall
    0.616,  // word_corner
    1.286,  // word_middle
    1.151,  // word_high
    1.474,  // word_low
    0.345,  // word_big
    0.645,  // word_small
    0.15,   // word_long
    0.433,  // word_tall
    0.383,  // word_even
    0.436,  // word_light
    1.198,  // word_dark
    0.675,  // word_hue
    0.704,  // word_end
    1.201,  // word_alone
    0.314,  // word_side
    0.123,  // word_far
    0.147,  // word_entry
];
