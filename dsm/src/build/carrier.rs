//! What carries the camera, as far as it gets in its own view.

use crate::geometry::OrientedBox;
use nalgebra::Point2;

/// Bodies that are not part of the surroundings, at the moment of the frame, world frame. Points inside them are dropped
/// from objects and from free space.
#[derive(Clone, Debug, Default)]
pub struct Carrier {
    /// Boxes around the bodies that the camera may see.
    pub bodies: Vec<OrientedBox>,
    /// Where the carrier stands: centre and radius in metres. It is free floor that its camera cannot see.
    pub footprint: Option<(Point2<f64>, f64)>,
}
