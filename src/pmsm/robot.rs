//! The reference robot: six axes of a medium-sized arm, and what each of them does.

use super::temperature::{Celsius, Reading};
use super::{MotorError, PolePairs, SQRT_3_2};
use serde::{Deserialize, Serialize};

/// One axis: motor, load and limits. Values at 20 C, seen from the motor's side of the gear.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotAxis {
    /// Number, from 1 at the foot.
    pub number: u8,
    /// Pole pairs.
    pub pole_pairs: PolePairs,
    /// Phase resistance of the motor (ohm).
    pub rs: f64,
    /// Synchronous inductance (H).
    pub ls: f64,
    /// Line-to-line rms back-EMF per mechanical speed (V s/rad).
    pub ke: f64,
    /// Inertia, motor and load (kg m^2).
    pub j: f64,
    /// Largest speed (rad/s).
    pub w_max: f64,
    /// Largest acceleration (rad/s^2).
    pub a_max: f64,
    /// Gravity's torque where the arm is level (N m).
    pub tg: f64,
    /// Cable resistance per phase (ohm), 20 m.
    pub r_cable: f64,
    /// Largest current (A, phase peak).
    pub i_max: f64,
    /// Coulomb friction (N m).
    pub tc: f64,
    /// Viscous friction (N m s).
    pub bv: f64,
    /// Gear ratio.
    pub gear: f64,
    /// Cogging torque, 24 periods per revolution (N m, peak).
    pub cogging: f64,
    /// Sample time of the drive (s).
    pub ts: f64,
}

/// Phase peak voltage limit of the reference drive: [`RobotAxis::V_DC`] through space-vector modulation (V).
#[cfg(feature = "std")]
pub(super) const V_MAX: f64 = 346.410_161_513_775_44;

impl RobotAxis {
    /// Sample time of the reference drive (s).
    pub const TS: f64 = 0.126e-3;

    /// Direct voltage of the reference drive (V).
    pub const V_DC: f64 = 600.0;

    /// Axis 1 to 6 of the reference robot.
    ///
    /// # Errors
    /// A number that is not 1 to 6.
    pub const fn reference(number: u8) -> Result<RobotAxis, MotorError> {
        //       R,    L mH, Ke,  J,      w_max, acc,    Tg,  cable, Imax, Tc,   Bv,     gear,  cogging
        let row = match number {
            1 => [0.40, 4.0, 0.95, 0.012, 350.0, 900.0, 0.0, 0.23, 60.0, 1.2, 0.004, 120.0, 0.108],
            2 => [0.32, 3.6, 0.95, 0.015, 340.0, 800.0, 6.0, 0.23, 60.0, 1.5, 0.005, 110.0, 0.135],
            3 => [0.38, 4.0, 0.90, 0.010, 350.0, 900.0, 4.0, 0.23, 60.0, 1.2, 0.004, 110.0, 0.108],
            4 => [0.80, 5.5, 0.62, 0.0016, 450.0, 1500.0, 0.0, 0.459, 20.0, 0.45, 0.0012, 90.0, 0.0405],
            5 => [0.85, 6.0, 0.60, 0.0014, 450.0, 1500.0, 0.0, 0.459, 20.0, 0.40, 0.0010, 90.0, 0.036],
            6 => [0.92, 6.5, 0.50, 0.0007, 450.0, 1800.0, 0.0, 0.459, 15.0, 0.28, 0.0006, 60.0, 0.0252],
            _ => {
                return Err(MotorError::OutOfRange {
                    quantity: "number of the robot's axis",
                    value: number as f64,
                    unit: "",
                    must: "be 1 to 6",
                });
            }
        };
        let pole_pairs = match PolePairs::new(4) {
            Ok(pole_pairs) => pole_pairs,
            Err(error) => return Err(error),
        };
        let [rs, l_mh, ke, j, w_max, a_max, tg, r_cable, i_max, tc, bv, gear, cogging] = row;
        let ls = l_mh / 1000.0;
        Ok(RobotAxis {
            number,
            pole_pairs,
            rs,
            ls,
            ke,
            j,
            w_max,
            a_max,
            tg,
            r_cable,
            i_max,
            tc,
            bv,
            gear,
            cogging,
            ts: Self::TS,
        })
    }

    /// Torque per ampere of peak iq (N m/A).
    pub fn kt(&self) -> f64 {
        SQRT_3_2 * self.ke
    }

    /// The axis with winding and magnet at these temperatures.
    pub fn heated(&self, winding_at: Celsius, magnet_at: Celsius) -> RobotAxis {
        RobotAxis {
            rs: self.rs * winding_at.winding_factor(),
            ke: self.ke * magnet_at.magnet_factor(Reading::Local),
            ..*self
        }
    }

    /// Refuses an axis that no motor is like.
    ///
    /// # Errors
    /// The first quantity outside its range.
    pub fn check(&self) -> Result<(), MotorError> {
        for (quantity, value, unit) in [
            ("resistance", self.rs, "ohm"),
            ("inductance", self.ls, "H"),
            ("Ke", self.ke, "V s/rad"),
            ("inertia", self.j, "kg m^2"),
            ("current limit", self.i_max, "A"),
            ("gear ratio", self.gear, "turns"),
            ("sample time", self.ts, "s"),
        ] {
            MotorError::positive(quantity, value, unit)?;
        }
        for (quantity, value, unit) in [
            ("cable resistance", self.r_cable, "ohm"),
            ("Coulomb friction", self.tc, "N m"),
            ("viscous friction", self.bv, "N m s"),
            ("gravity torque", self.tg, "N m"),
            ("cogging torque", self.cogging, "N m"),
        ] {
            MotorError::finite(quantity, value, unit)?;
        }
        Ok(())
    }
}
