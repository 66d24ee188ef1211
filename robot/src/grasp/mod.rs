//! Grasp planning on the fused cloud of an object.
