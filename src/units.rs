//! Factors from what instruments show to the units of the models: `w * RPM` is rad/s if `w` is in revolutions per minute.

use core::f64::consts::PI;

/// One revolution per minute (rad/s).
pub const RPM: f64 = PI / 30.0;
/// One degree (rad).
pub const DEGREE: f64 = PI / 180.0;
/// One revolution (rad).
pub const REVOLUTION: f64 = 2.0 * PI;
/// 0 degrees Celsius (K): an offset, not a factor.
pub const ZERO_CELSIUS: f64 = 273.15;
