//! Factors from what instruments show to the units of the models: `w * RPM` is rad/s if `w` is in revolutions per minute.

use core::f64::consts::PI;

/// One revolution per minute (rad/s).
pub const RPM: f64 = PI / 30.0;
