//! A servo drive in simulation: controllers, inverter, cable, motor, load and sensors of one robot axis.
//!
//! Each sample: measure; log the measurements with the command that acts *from now on*; compute the next command, which
//! acts one sample later, turned to where the rotor will then be; let the plant run. The same seed gives the same record,
//! bit for bit.

use super::control::{Command, CurrentControl, SpeedControl};
use super::frames::{Stator, rotate_into, rotate_out_of};
use super::inverter::{Carrier, DeadTime, Inverter};
pub use super::log::{Log, Row};
use super::plant::Plant;
use super::program::Program;
use super::robot::{RobotAxis, V_MAX};
use super::sensors::{CurrentSensors, Resolver};
use super::temperature::Celsius;
use super::{Currents, Injection, MachineState, MotorError, PolePairs, SQRT_3_2, SwitchingInverter};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

/// Imperfections of a real drive; each may be switched off alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Disturbance {
    /// Voltage lost in the inverter.
    DeadTime,
    /// Resistance of the cable.
    Cable,
    /// Noise of the current sensors.
    CurrentNoise,
    /// Steps of the current converters.
    CurrentSteps,
    /// Noise of the resolver.
    AngleNoise,
    /// Steps of the resolver's converter.
    AngleSteps,
    /// Unevenness of the resolver.
    AngleUnevenness,
    /// Cogging torque.
    Cogging,
    /// Sixth harmonic in EMF and torque.
    EmfHarmonic,
    /// Coulomb and viscous friction.
    Friction,
    /// Gravity.
    Gravity,
    /// `Ld` below, `Lq` above the nominal inductance.
    Saliency,
    /// Fall of `Lq` with the current.
    Saturation,
}

impl Disturbance {
    /// All of them.
    pub const ALL: [Disturbance; 13] = [
        Disturbance::DeadTime,
        Disturbance::Cable,
        Disturbance::CurrentNoise,
        Disturbance::CurrentSteps,
        Disturbance::AngleNoise,
        Disturbance::AngleSteps,
        Disturbance::AngleUnevenness,
        Disturbance::Cogging,
        Disturbance::EmfHarmonic,
        Disturbance::Friction,
        Disturbance::Gravity,
        Disturbance::Saliency,
        Disturbance::Saturation,
    ];
}

/// The drive of one axis, ready to run a [`Program`].
///
/// ```
/// use greybox::pmsm::{drive::{Disturbance, Simulation}, program::Program, robot::RobotAxis};
/// let axis = RobotAxis::reference(1)?;
/// let program = Program::speed_cycles(&axis, 2, 1.0)?;
/// let log = Simulation::new(axis)?.without(Disturbance::DeadTime).run(&program);
/// assert_eq!(log.rows.len(), program.targets.len());
/// # Ok::<(), greybox::pmsm::MotorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simulation {
    /// The axis that the controllers are designed for: data sheet, 20 C.
    pub nominal: RobotAxis,
    /// The axis.
    pub plant: Plant,
    /// The inverter.
    pub inverter: Inverter,
    /// Current sensors.
    pub currents: CurrentSensors,
    /// Angle sensor.
    pub resolver: Resolver,
    /// Current control.
    pub current_control: CurrentControl,
    /// Speed control.
    pub speed_control: SpeedControl,
    /// d current that is injected to see the resistance; `None` for id = 0.
    pub injection: Option<Injection>,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Midpoint steps of the plant in one sample; where the inverter switches, no step is longer than that.
    pub substeps: u32,
}

/// Corner of the controllers' one-pole speed filter (Hz).
const SPEED_FILTER: f64 = 300.0;

impl Simulation {
    /// The reference drive of an axis with all disturbances, winding and magnet at 20 C.
    ///
    /// # Errors
    /// A quantity of the axis outside its range.
    pub fn new(axis: RobotAxis) -> Result<Self, MotorError> {
        axis.check()?;
        let control = CurrentControl::lambda_tuned(axis.rs, axis.ls, axis.ke, axis.pole_pairs, 1e-3)?;
        let speed = SpeedControl::tuned(axis.j, 60.0, 0.9)?;
        Ok(Simulation {
            nominal: axis,
            plant: Plant {
                axis,
                dead_time: DeadTime { vdt: 2.0, i0: 0.15 },
                emf_harmonic: 0.01,
                saliency: 0.04,
                saturation: 0.1,
            },
            inverter: Inverter::Averaged,
            currents: CurrentSensors::twelve_bit(axis.i_max),
            resolver: Resolver::SIXTEEN_BIT,
            current_control: control.limited(V_MAX),
            speed_control: SpeedControl { kv: 20.0, torque_max: axis.kt() * axis.i_max, ..speed },
            injection: None,
            seed: axis.number as u64,
            substeps: 6,
        })
    }

    /// With one disturbance switched off.
    pub fn without(mut self, disturbance: Disturbance) -> Self {
        let plant = &mut self.plant;
        match disturbance {
            Disturbance::DeadTime => plant.dead_time.vdt = 0.0,
            Disturbance::Cable => plant.axis.r_cable = 0.0,
            Disturbance::CurrentNoise => self.currents.noise = 0.0,
            Disturbance::CurrentSteps => self.currents.step = 0.0,
            Disturbance::AngleNoise => self.resolver.noise = 0.0,
            Disturbance::AngleSteps => self.resolver.step = 0.0,
            Disturbance::AngleUnevenness => self.resolver.unevenness = 0.0,
            Disturbance::Cogging => plant.axis.cogging = 0.0,
            Disturbance::EmfHarmonic => plant.emf_harmonic = 0.0,
            Disturbance::Friction => (plant.axis.tc, plant.axis.bv) = (0.0, 0.0),
            Disturbance::Gravity => plant.axis.tg = 0.0,
            Disturbance::Saliency => plant.saliency = 0.0,
            Disturbance::Saturation => plant.saturation = 0.0,
        }
        self
    }

    /// With every disturbance switched off.
    pub fn undisturbed(self) -> Self {
        Disturbance::ALL.into_iter().fold(self, Simulation::without)
    }

    /// With winding and magnet at other temperatures; the controllers keep the values at 20 C.
    pub fn heated(mut self, winding_at: Celsius, magnet_at: Celsius) -> Self {
        self.plant.axis = self.plant.axis.heated(winding_at, magnet_at);
        self
    }

    /// With d current injected.
    pub fn injecting(self, injection: Injection) -> Self {
        Simulation { injection: Some(injection), ..self }
    }

    /// With an inverter that switches a direct voltage `vdc` (V).
    ///
    /// # Errors
    /// A direct voltage that cannot make the longest vector of the current control: `sqrt(3)` times its limit is needed.
    pub fn switching(self, vdc: f64, carrier: Carrier) -> Result<Self, MotorError> {
        // Ten roundings: 600 V make exactly the 346.41 V that they allow.
        if vdc.is_finite() && vdc >= 3f64.sqrt() * self.current_control.v_max * (1.0 - 1e-15) {
            return Ok(Simulation { inverter: Inverter::Switching { vdc, carrier }, ..self });
        }
        let must = "be finite and at least sqrt(3) times the voltage limit of the current control";
        Err(MotorError::OutOfRange { quantity: "direct voltage", value: vdc, unit: "V", must })
    }

    /// With another seed for the sensors' noise.
    pub fn seeded(self, seed: u64) -> Self {
        Simulation { seed, ..self }
    }

    /// Runs a program from rest, at the program's sample time.
    pub fn run(&self, program: &Program) -> Log {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut current_control, mut speed_control) = (self.current_control, self.speed_control);
        let (np, ts) = (self.nominal.pole_pairs, program.ts);
        let (kt, i_max) = (SQRT_3_2 * self.nominal.ke, self.nominal.i_max);
        let blend = 1.0 - (-2.0 * core::f64::consts::PI * SPEED_FILTER * ts).exp();

        let mut log =
            Log { ts, rows: Vec::with_capacity(program.targets.len()), voltage_limited: 0, current_limited: 0 };
        let mut x = MachineState::default();
        let mut last_theta = None;
        let mut wf = 0.0;
        let mut switching = match self.inverter {
            Inverter::Averaged => None,
            Inverter::Switching { vdc, carrier } => Some(SwitchingInverter::new(&self.plant, vdc, carrier)),
        };
        let (mut acting, mut held) = (Command::default(), Stator::default());
        for (k, target) in program.targets.iter().enumerate() {
            let theta = self.resolver.read(x.theta, draw());
            let (alpha, beta) = rotate_out_of((x.id, x.iq), self.plant.axis.pole_pairs.electrical(x.theta));
            let read = self.currents.read(Stator { alpha, beta }, [draw(), draw()]);
            let (id, iq) = rotate_into((read.alpha, read.beta), np.electrical(theta));
            let w = (theta - last_theta.unwrap_or(theta)) / ts;
            last_theta = Some(theta);
            wf += blend * (w - wf);

            let (torque, current_limited) = speed_control.step(*target, theta, wf, ts);
            let iq_ref = (torque / kt).clamp(-i_max, i_max);
            let id_ref = self.injection.map_or(0.0, |injection| injection.id(k as f64 * ts));
            let reference = Currents { id: id_ref, iq: iq_ref };
            let command = current_control.step(reference, Currents { id, iq }, wf, ts);
            log.voltage_limited += usize::from(command.limited);
            log.current_limited += usize::from(current_limited);
            log.rows.push(Row { ud: acting.ud, uq: acting.uq, w, id, iq, theta, iq_ref, w_ref: target.w, truth: x });

            x = match &mut switching {
                None => self.plant.advance(x, held, ts, self.substeps),
                Some(switching) => switching.advance(x, held, ts, self.substeps, |_, _| {}),
            };
            held = aim((command.ud, command.uq), np.electrical(theta), wf, np, ts);
            acting = command;
        }
        log
    }
}

/// The time from a measurement to the middle of the interval in which the voltage computed from it acts, in sample times:
/// one for the computation, half of the hold.
const DELAY: f64 = 1.5;

/// The stationary voltage vector for a command (V, rotor frame) computed at electrical angle `theta_e` (rad) and speed `w`
/// (rad/s, mechanical), aimed at the rotor's angle in the middle of the interval in which it will act.
#[inline]
fn aim(command: (f64, f64), theta_e: f64, w: f64, pole_pairs: PolePairs, ts: f64) -> Stator {
    let (alpha, beta) = rotate_out_of(command, theta_e + DELAY * pole_pairs.electrical(w) * ts);
    Stator { alpha, beta }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pmsm::program::Program;

    fn short(simulation: Simulation) -> Log {
        simulation.run(&Program::speed_cycles(&simulation.nominal, 2, 1.0).unwrap())
    }

    fn reference() -> Simulation {
        Simulation::new(RobotAxis::reference(2).unwrap()).unwrap()
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_does_not() {
        assert_eq!(short(reference()), short(reference()));
        assert_ne!(short(reference()), short(reference().seeded(99)));
    }

    // Each disturbance shows in the record by itself, and with all of them off the measurement is the truth.
    #[test]
    fn every_disturbance_is_there_and_can_be_switched_off() {
        let all = short(reference());
        for disturbance in Disturbance::ALL {
            assert_ne!(short(reference().without(disturbance)), all, "{disturbance:?}");
        }
        let ideal = short(reference().undisturbed());
        for row in &ideal.rows {
            assert!((row.id - row.truth.id).abs() < 1e-12 && (row.iq - row.truth.iq).abs() < 1e-12);
            assert_eq!(row.theta, row.truth.theta);
        }
    }

    #[test]
    fn the_drive_follows_its_program_within_its_limits() {
        let log = short(reference());
        assert_eq!((log.voltage_limited, log.current_limited), (0, 0));
        for row in &log.rows {
            assert!((row.truth.w - row.w_ref).abs() < 5.0, "{} for {}", row.truth.w, row.w_ref);
            assert!(row.ud.hypot(row.uq) <= V_MAX * (1.0 + 1e-12));
        }
        let end = log.rows.last().unwrap();
        assert!(end.truth.theta.abs() < 0.05, "forth and back: {}", end.truth.theta);
    }

    #[test]
    fn limits_are_counted() {
        let axis = RobotAxis::reference(1).unwrap();
        // Beyond the speed at which the EMF uses up the voltage.
        let fast = Program::speed_cycles(&RobotAxis { w_max: 600.0, ..axis }, 2, 1.0).unwrap();
        let log = Simulation::new(axis).unwrap().run(&fast);
        assert!(log.voltage_limited > 0);
        let expected = format!("the voltage was at its limit in {} of", log.voltage_limited);
        assert!(log.warnings()[0].starts_with(&expected), "{:?}", log.warnings());
        // More acceleration than the current can make.
        let hard = Program::speed_cycles(&axis, 2, 12.0).unwrap();
        let log = Simulation::new(axis).unwrap().run(&hard);
        let expected = format!("the current reference was at its limit in {} of", log.current_limited);
        assert!(log.warnings().iter().any(|warning| warning.starts_with(&expected)), "{:?}", log.warnings());
        // Within its limits it has nothing to say.
        assert_eq!(short(reference()).warnings(), Vec::<String>::new());
    }

    #[test]
    fn impossible_axes_are_refused() {
        assert!(RobotAxis::reference(7).unwrap_err().to_string().contains("number of the robot's axis is 7"));
        let axis = RobotAxis::reference(1).unwrap();
        let error = Simulation::new(RobotAxis { ls: -4e-3, ..axis }).unwrap_err();
        assert_eq!(error.to_string(), "inductance is -0.004 H; it must be positive and finite");
        assert!(Simulation::new(RobotAxis { r_cable: f64::NAN, ..axis }).is_err());
    }
}
