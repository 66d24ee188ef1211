//! Joint values that know their joints.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The ordered names of a group of joints. Cheap to clone.
pub type JointNames = Arc<[Arc<str>]>;

macro_rules! joint_vector {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub struct $name {
            names: JointNames,
            values: Vec<f64>,
        }

        impl $name {
            /// Zero for every joint.
            pub fn zeros(names: &JointNames) -> Self {
                Self { names: names.clone(), values: vec![0.0; names.len()] }
            }

            /// Values in the order of `names`; `None` when the lengths differ.
            pub fn from_values(names: &JointNames, values: Vec<f64>) -> Option<Self> {
                (names.len() == values.len()).then(|| Self { names: names.clone(), values })
            }

            /// Names in order.
            pub fn names(&self) -> &JointNames {
                &self.names
            }

            /// Values in the order of the names.
            pub fn values(&self) -> &[f64] {
                &self.values
            }

            /// Values in the order of the names, to be changed.
            pub fn values_mut(&mut self) -> &mut [f64] {
                &mut self.values
            }

            /// The value of one joint.
            pub fn find(&self, name: &str) -> Option<f64> {
                self.names.iter().position(|n| &**n == name).map(|i| self.values[i])
            }

            /// Names with values.
            pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
                self.names.iter().map(|n| &**n).zip(self.values.iter().copied())
            }
        }
    };
}

joint_vector! {
    /// Joint positions: radians for revolute, metres for prismatic joints.
    JointPositions
}
joint_vector! {
    /// Joint velocities: radians or metres per second.
    JointVelocities
}
