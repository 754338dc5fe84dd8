//! The controllers of a servo drive: current PI, speed PI, position P (thesis 4.2).
//!
//! They hold no heap and need no `std`: the same code may run in a drive.

use super::{Currents, MotorError, PolePairs, SQRT_2_3};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Which currents the cross-coupling of the axes is compensated with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Decoupling {
    /// The measured ones.
    #[default]
    Measured,
    /// The references: no loop through the delay, but at speed more overshoot and cross-axis error (6.3 % and 27 % against
    /// 1.7 % and 15 % at 350 rad/s on axis 1 of the reference robot, lambda four samples).
    References,
}

/// Proportional-integral control of both current axes, with decoupling and EMF feed-forward:
///
/// ```text
/// ud = kp ed + ki int ed - we ls iq
/// uq = kp eq + ki int eq + we ls id + sqrt(2/3) ke w
/// ```
///
/// A voltage longer than `v_max` is shortened in its direction, and the integrators then stand still.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurrentControl {
    /// Proportional gain (V/A).
    pub kp: f64,
    /// Integral gain (V/(A s)).
    pub ki: f64,
    /// Inductance in the decoupling (H).
    pub ls: f64,
    /// Line-to-line rms back-EMF (V s/rad) in the feed-forward; an online estimate may replace it at any time.
    pub ke: f64,
    /// Longest voltage vector (V, phase peak); infinite for no limit.
    pub v_max: f64,
    /// Pole pairs.
    pub pole_pairs: PolePairs,
    /// Which currents decouple.
    pub decoupling: Decoupling,
    /// Integrators (V).
    pub integral: Currents,
}

/// A commanded voltage in the rotor frame (V, phase peak).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Along the magnet flux.
    pub ud: f64,
    /// 90 electrical degrees ahead of it.
    pub uq: f64,
    /// Whether it was shortened to the limit.
    pub limited: bool,
}

impl CurrentControl {
    /// Lambda tuning: `kp = ls/lambda`, `ki = rs/lambda` give a first-order closed loop of time constant `lambda` (s). The
    /// voltage is not limited; see [`CurrentControl::limited`]. With one sample of computation delay and a held voltage, the
    /// current does not overshoot at standstill from `lambda` of four sample times on.
    ///
    /// # Errors
    /// A `lambda`, resistance or inductance that is not positive; a back-EMF that is not finite.
    pub fn lambda_tuned(rs: f64, ls: f64, ke: f64, pole_pairs: PolePairs, lambda: f64) -> Result<Self, MotorError> {
        let lambda = MotorError::positive("closed-loop time constant lambda", lambda, "s")?;
        Ok(CurrentControl {
            kp: MotorError::positive("inductance", ls, "H")? / lambda,
            ki: MotorError::positive("resistance", rs, "ohm")? / lambda,
            ls,
            ke: MotorError::finite("Ke", ke, "V s/rad")?,
            v_max: f64::INFINITY,
            pole_pairs,
            decoupling: Decoupling::Measured,
            integral: Currents::default(),
        })
    }

    /// With a voltage limit (V, phase peak).
    pub fn limited(self, v_max: f64) -> Self {
        CurrentControl { v_max, ..self }
    }

    /// The voltage for the measured currents and speed `w` (rad/s), then one step of the integrators over `ts` (s).
    #[inline]
    pub fn step(&mut self, reference: Currents, measured: Currents, w: f64, ts: f64) -> Command {
        let we = self.pole_pairs.electrical(w);
        let (ed, eq) = (reference.id - measured.id, reference.iq - measured.iq);
        let i = if self.decoupling == Decoupling::Measured { measured } else { reference };
        let ud = self.kp * ed + self.integral.id - we * self.ls * i.iq;
        let uq = self.kp * eq + self.integral.iq + we * self.ls * i.id + SQRT_2_3 * self.ke * w;
        let length = Scalar::hypot(ud, uq);
        if length > self.v_max {
            let shorter = self.v_max / length;
            return Command { ud: ud * shorter, uq: uq * shorter, limited: true };
        }
        self.integral.id += self.ki * ed * ts;
        self.integral.iq += self.ki * eq * ts;
        Command { ud, uq, limited: false }
    }
}

/// Where a speed controller is to go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Speed (rad/s).
    pub w: f64,
    /// Its rate of change (rad/s^2), fed forward.
    pub a: f64,
}

/// Proportional-integral control of the speed with acceleration feed-forward, and a proportional feedback of the angle that
/// the references add up to:
///
/// ```text
/// ew = w_ref + kv (theta_ref - theta) - w         torque = kp ew + ki int ew + j a_ref
/// ```
///
/// `kp = 2 zeta wc j`, `ki = wc^2 j`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedControl {
    /// Proportional gain (N m s).
    pub kp: f64,
    /// Integral gain (N m).
    pub ki: f64,
    /// Inertia fed forward (kg m^2).
    pub j: f64,
    /// Feedback of the angle error (1/s); zero for a pure speed controller.
    pub kv: f64,
    /// Largest torque (N m); infinite for no limit.
    pub torque_max: f64,
    /// The angle that the references have added up to (rad).
    pub theta: f64,
    /// Integrator (N m).
    pub integral: f64,
}

impl SpeedControl {
    /// Bandwidth `wc` (rad/s) and damping `zeta` for an inertia `j` (kg m^2).
    ///
    /// # Errors
    /// An inertia, bandwidth or damping that is not positive.
    pub fn tuned(j: f64, wc: f64, zeta: f64) -> Result<Self, MotorError> {
        let j = MotorError::positive("inertia", j, "kg m^2")?;
        let wc = MotorError::positive("bandwidth of the speed control", wc, "rad/s")?;
        let kp = 2.0 * MotorError::positive("damping of the speed control", zeta, "of 1")? * wc * j;
        let torque_max = f64::INFINITY;
        Ok(SpeedControl { kp, ki: wc * wc * j, j, kv: 0.0, torque_max, theta: 0.0, integral: 0.0 })
    }

    /// Torque (N m) for the measured angle `theta` (rad) and speed `w` (rad/s), and whether it is at its limit, where the
    /// integrator stands still; `ts` is the sample time (s).
    #[inline]
    pub fn step(&mut self, target: Target, theta: f64, w: f64, ts: f64) -> (f64, bool) {
        self.theta += target.w * ts;
        let error = target.w + self.kv * (self.theta - theta) - w;
        let torque = self.kp * error + self.integral + self.j * target.a;
        let kept = Scalar::clamp(torque, -self.torque_max, self.torque_max);
        let limited = kept != torque;
        if !limited {
            self.integral += self.ki * error * ts;
        }
        (kept, limited)
    }
}

/// Proportional control of the position: a speed reference that brakes in time and changes no faster than allowed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PositionControl {
    /// Gain (1/s).
    pub kv: f64,
    /// Largest speed (rad/s).
    pub w_max: f64,
    /// Largest acceleration (rad/s^2).
    pub a_max: f64,
    /// The speed reference so far (rad/s).
    pub w: f64,
}

impl PositionControl {
    /// Gain `kv` (1/s), largest speed (rad/s) and acceleration (rad/s^2).
    ///
    /// # Errors
    /// A gain, speed or acceleration that is not positive.
    pub fn new(kv: f64, w_max: f64, a_max: f64) -> Result<Self, MotorError> {
        Ok(PositionControl {
            kv: MotorError::positive("gain of the position control", kv, "1/s")?,
            w_max: MotorError::positive("largest speed", w_max, "rad/s")?,
            a_max: MotorError::positive("largest acceleration", a_max, "rad/s^2")?,
            w: 0.0,
        })
    }

    /// The speed reference for a position `error` (rad): at most `w_max`, at most `sqrt(2 a_max |error|)`, and within
    /// `a_max ts` of the one before.
    #[inline]
    pub fn step(&mut self, error: f64, ts: f64) -> Target {
        let most = Scalar::min(self.w_max, Scalar::sqrt(2.0 * self.a_max * Scalar::abs(error)));
        let wanted = Scalar::clamp(self.kv * error, -most, most);
        let change = Scalar::clamp(wanted - self.w, -self.a_max * ts, self.a_max * ts);
        self.w += change;
        Target { w: self.w, a: change / ts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORTEST_LAMBDA: f64 = 4.0;

    const TS: f64 = 0.126e-3;
    const RS: f64 = 0.4;
    const LS: f64 = 4e-3;

    /// Step of iq to 1 A at constant speed with one sample of delay, the voltage turned by `1.5 we ts` and held in the
    /// stationary frame; exact solution of the motor between samples. Largest iq, and largest |id|.
    fn step_response(lambda: f64, w: f64, decoupling: Decoupling) -> (f64, f64) {
        let np = PolePairs::new(4).unwrap();
        let mut control = CurrentControl::lambda_tuned(RS, LS, 0.0, np, lambda).unwrap();
        control.decoupling = decoupling;
        let (a, we) = (RS / LS, np.electrical(w));
        // x' = -(a + j we) x + u/L in the rotor frame, u turning backwards at we: x+ = e^{-(a+jwe)Ts} x + e^{-jwe Ts/2} g u/L.
        let turn = |(d, q): (f64, f64), angle: f64| super::super::frames::rotate_into((d, q), angle);
        let (decay, gain) = ((-a * TS).exp(), (1.0 - (-a * TS).exp()) / a / LS);
        let (mut x, mut acting, mut peak, mut cross) = ((0.0, 0.0), (0.0, 0.0), 0f64, 0f64);
        for _ in 0..4000 {
            let measured = Currents { id: x.0, iq: x.1 };
            let command = control.step(Currents { id: 0.0, iq: 1.0 }, measured, w, TS);
            let (free, forced) = (turn(x, we * TS), turn(acting, 0.5 * we * TS));
            x = (decay * free.0 + gain * forced.0, decay * free.1 + gain * forced.1);
            acting = (command.ud, command.uq);
            peak = peak.max(x.1);
            cross = cross.max(x.0.abs());
        }
        assert!((x.1 - 1.0).abs() < 1e-6 && x.0.abs() < 1e-6, "the integrators settle: {x:?}");
        (peak - 1.0, cross)
    }

    #[test]
    fn four_samples_of_lambda_do_not_overshoot_at_standstill() {
        // The integrator is a sum and the motor's pole an exponential; that mismatch leaves 0.03 % at any lambda.
        let (overshoot, _) = step_response(SHORTEST_LAMBDA * TS, 0.0, Decoupling::Measured);
        let (slow, _) = step_response(16.0 * TS, 0.0, Decoupling::Measured);
        assert!(overshoot <= slow && slow < 4e-4, "{overshoot} {slow}");
        // Three do: the limit is not an idle one.
        assert!(step_response(3.0 * TS, 0.0, Decoupling::Measured).0 > 0.03);
    }

    // At 350 rad/s 1.7 % overshoot and 15 % cross-axis with measured currents, 6.3 % overshoot with references.
    #[test]
    fn at_speed_the_delay_shows() {
        let (overshoot, cross) = step_response(SHORTEST_LAMBDA * TS, 350.0, Decoupling::Measured);
        assert!((overshoot - 0.017).abs() < 5e-4 && (cross - 0.154).abs() < 1e-3, "{overshoot} {cross}");
        let (overshoot, cross) = step_response(SHORTEST_LAMBDA * TS, 350.0, Decoupling::References);
        assert!((overshoot - 0.063).abs() < 5e-4 && (cross - 0.273).abs() < 1e-3, "{overshoot} {cross}");
    }

    #[test]
    fn a_limited_voltage_keeps_its_direction_and_stops_the_integrators() {
        let np = PolePairs::new(4).unwrap();
        let mut control = CurrentControl::lambda_tuned(RS, LS, 0.95, np, 1e-3).unwrap().limited(100.0);
        let command = control.step(Currents { id: 30.0, iq: 40.0 }, Currents::default(), 0.0, TS);
        assert!(command.limited && (command.ud.hypot(command.uq) - 100.0).abs() < 1e-12);
        assert!((command.ud / command.uq - 0.75).abs() < 1e-12);
        assert_eq!(control.integral, Currents::default());
    }

    #[test]
    fn position_is_reached_without_overshoot_and_within_the_limits() {
        let mut control = PositionControl::new(5.0, 300.0, 60.0).unwrap();
        let (mut theta, mut w, ts) = (0.0, 0.0, 1e-3);
        for _ in 0..30_000 {
            let target = control.step(2400.0 - theta, ts);
            assert!(target.a.abs() <= 60.0 * (1.0 + 1e-12) && target.w.abs() <= 300.0);
            theta += 0.5 * (w + target.w) * ts;
            w = target.w;
            assert!(theta < 2400.0 + 0.5);
        }
        assert!((theta - 2400.0).abs() < 1e-3, "{theta}");
    }

    #[test]
    fn nonsense_is_refused() {
        let np = PolePairs::new(4).unwrap();
        let error = CurrentControl::lambda_tuned(0.4, -4e-3, 0.9, np, 1e-3).unwrap_err();
        assert_eq!(error.to_string(), "inductance is -0.004 H; it must be positive and finite");
        assert!(SpeedControl::tuned(0.0, 60.0, 0.9).is_err());
        assert!(PositionControl::new(5.0, f64::NAN, 60.0).is_err());
    }
}
