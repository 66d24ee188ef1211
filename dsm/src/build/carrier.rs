//! What carries the camera, as far as it gets in its own view.

use crate::geometry::OrientedBox;
use crate::map::ObjectId;
use nalgebra::{Point2, Vector3};

/// Bodies that are not part of the surroundings, at the moment of the frame, world frame. Points inside them are dropped
/// from objects and from free space.
#[derive(Clone, Debug, Default)]
pub struct Carrier {
    /// Boxes around the bodies that the camera may see.
    pub bodies: Vec<OrientedBox>,
    /// Where the carrier stands: centre and radius in metres. It is free floor that its camera cannot see.
    pub footprint: Option<(Point2<f64>, f64)>,
    /// Objects that the carrier moved since the last frame, and by what, world frame, metres: what lies in a drawer moves with
    /// it, where nobody sees it.
    pub moved: Vec<(ObjectId, Vector3<f64>)>,
    /// Boxes through which the carrier moved what is no object of its own, such as the leaf of a door, since the last frame: what
    /// stood in there is looked at afresh.
    pub swept: Vec<OrientedBox>,
    /// Objects that the carrier has found not to be where the map has them: a hand that reaches for a thing in a shelf sees
    /// past it where rays from farther off meet the shelf right behind.
    pub missed: Vec<ObjectId>,
}
