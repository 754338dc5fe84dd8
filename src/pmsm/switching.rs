use super::frames::{Stator, clarke, inverse_clarke, rotate_out_of};
use super::inverter::{Carrier, DeadTime, duties};
use super::machine::runge_kutta;
use super::plant::Plant;
use super::{MachineState, PolePairs};
use crate::scalar::Scalar;

/// A two-level inverter that switches, with the motor that it feeds.
///
/// The duties of a held voltage are compared with a triangular carrier, whose extrema are the sampling instants: there all
/// legs stand on one side, and the ripple of the current passes through zero. Edges happen to the instant; between them
/// the voltage stands still in the stator's frame and the motion is solved by Runge-Kutta 4 (against the exact step of
/// a motor without saliency: below 1e-6 A).
///
/// Dead time delays the edges that the valves must make by themselves: for a current out of the leg those up, else those
/// down; the diodes make the others at once. Near zero current the valves' capacitances share the delay between the two,
/// `1/2 (1 +- tanh(i/i0))`, so that the mean voltage lost in a carrier period is the `vdt tanh(i/i0)` of [`DeadTime`].
/// Pulses shorter than the delay are swallowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SwitchingInverter {
    plant: Plant,
    vdc: f64,
    carrier: Carrier,
    dead_time: DeadTime,
    /// Which upper valves conduct.
    upper: [bool; 3],
    /// Edges that wait for the end of the dead time.
    pending: [Option<Edge>; 3],
    /// The half of the carrier that comes next, where a sample has but one.
    down: bool,
}

/// One leg goes up or down at a time (s) after the begin of the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge {
    at: f64,
    leg: usize,
    up: bool,
}

impl SwitchingInverter {
    /// An inverter on `vdc` (V) before the motor of `plant`, with the dead time of `plant`; all legs down.
    pub fn new(plant: &Plant, vdc: f64, carrier: Carrier) -> Self {
        let none = DeadTime { vdt: 0.0, ..plant.dead_time };
        SwitchingInverter {
            plant: Plant { dead_time: none, ..*plant },
            vdc,
            carrier,
            dead_time: plant.dead_time,
            upper: [false; 3],
            pending: [None; 3],
            down: false,
        }
    }

    /// The motion after a sample of `ts` (s) from `x`, under the duties of the stationary voltage `u` (V), in steps of at
    /// most `ts / substeps`. `see` is shown time (s) after the begin of the sample and motion, step by step.
    pub fn advance(
        &mut self,
        mut x: MachineState,
        u: Stator,
        ts: f64,
        substeps: u32,
        mut see: impl FnMut(f64, &MachineState),
    ) -> MachineState {
        let longest = ts / substeps.max(1) as f64;
        let mut now = 0.0;
        let (edges, count) = self.edges(u, ts);
        for edge in edges.iter().take(count) {
            x = self.run(x, &mut now, edge.at, longest, &mut see);
            let at = now + self.delay(edge, &x, ts);
            self.pending[edge.leg] = Some(Edge { at, ..*edge });
        }
        x = self.run(x, &mut now, ts, longest, &mut see);
        for edge in self.pending.iter_mut().flatten() {
            edge.at -= ts;
        }
        self.down = !self.down;
        x
    }

    /// The edges that carrier and duties ask for in one sample, in order of time, and how many they are.
    fn edges(&self, u: Stator, ts: f64) -> ([Edge; 6], usize) {
        let d = duties(u, self.vdc);
        let mut edges = [Edge { at: ts, leg: 0, up: false }; 6];
        let mut count = 0;
        for (leg, d) in d.into_iter().enumerate() {
            let both = [(0.5 * (1.0 - d), true), (0.5 * (1.0 + d), false)];
            let half = [if self.down { (d, false) } else { (1.0 - d, true) }];
            let wanted: &[(f64, bool)] = if self.carrier == Carrier::PerSample { &both } else { &half };
            for &(at, up) in wanted {
                edges[count] = Edge { at: at * ts, leg, up };
                count += 1;
            }
        }
        edges[..count].sort_unstable_by(|a, b| a.at.total_cmp(&b.at));
        (edges, count)
    }

    /// By how much (s) dead time delays an edge at this motion.
    fn delay(&self, edge: &Edge, x: &MachineState, ts: f64) -> f64 {
        let DeadTime { vdt, i0 } = self.dead_time;
        if vdt == 0.0 {
            return 0.0;
        }
        let i = phase_currents(x, self.plant.axis.pole_pairs);
        let sign = Scalar::tanh(i[edge.leg] / i0);
        vdt / self.vdc * self.carrier.period(ts) * 0.5 * (1.0 + if edge.up { sign } else { -sign })
    }

    /// Goes on until `to`, with the edges that become due on the way.
    fn run(
        &mut self,
        mut x: MachineState,
        now: &mut f64,
        to: f64,
        longest: f64,
        see: &mut impl FnMut(f64, &MachineState),
    ) -> MachineState {
        loop {
            let due =
                self.pending.iter().flatten().min_by(|a, b| a.at.total_cmp(&b.at)).filter(|e| e.at <= to).copied();
            let end = due.map_or(to, |edge| edge.at);
            if end > *now {
                let steps = Scalar::ceil((end - *now) / longest);
                let h = (end - *now) / steps;
                let volts = |up: bool| if up { self.vdc } else { 0.0 };
                let u = clarke(self.upper.map(volts));
                for step in 1..=steps as u32 {
                    x = runge_kutta(x, h, |x| self.plant.derivative(x, u));
                    see(*now + step as f64 * h, &x);
                }
                *now = end;
            }
            let Some(edge) = due else { return x };
            self.upper[edge.leg] = edge.up;
            self.pending[edge.leg] = None;
        }
    }
}

fn phase_currents(x: &MachineState, pole_pairs: PolePairs) -> [f64; 3] {
    let (alpha, beta) = rotate_out_of((x.id, x.iq), pole_pairs.electrical(x.theta));
    inverse_clarke(Stator { alpha, beta })
}

#[cfg(test)]
mod tests {
    use super::super::frames::rotate_into;
    use super::super::robot::RobotAxis;
    use super::super::{Currents, Drive, ExactStep, HeldIn, Winding};
    use super::*;

    const CARRIERS: [Carrier; 2] = [Carrier::PerSample, Carrier::HalfPerSample];

    /// Axis 1, magnetically round, so heavy that its speed stays: what the exact step knows.
    fn round() -> Plant {
        let axis = RobotAxis { j: 1e12, r_cable: 0.0, ..RobotAxis::reference(1).unwrap() };
        let dead_time = DeadTime { vdt: 0.0, i0: 0.15 };
        Plant { axis, dead_time, emf_harmonic: 0.0, saliency: 0.0, saturation: 0.0 }
    }

    fn turned((d, q): (f64, f64), theta_e: f64) -> Stator {
        let (alpha, beta) = rotate_out_of((d, q), theta_e);
        Stator { alpha, beta }
    }

    // Edge after edge by the closed form; a hundred samples of Runge-Kutta 4 in steps below 21 us at 1400 rad/s electrical
    // differ by (0.03)^5/120 of some 10 A per step, a thousand times.
    #[test]
    fn between_the_edges_the_motion_is_exact() {
        let (plant, w) = (round(), 350.0);
        let winding = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };
        for carrier in CARRIERS {
            let mut inverter = SwitchingInverter::new(&plant, RobotAxis::V_DC, carrier);
            let mut x = MachineState { id: 2.0, iq: 10.0, w, theta: 0.3 };
            let mut i = Currents { id: x.id, iq: x.iq };
            for k in 0..100 {
                let begin = 4.0 * (0.3 + w * RobotAxis::TS * k as f64);
                let u = turned((-50.0, 280.0), begin + 2.0 * w * RobotAxis::TS);
                let d = duties(u, RobotAxis::V_DC);
                let mut edges = Vec::new();
                for (leg, d) in d.into_iter().enumerate() {
                    match carrier {
                        Carrier::PerSample => edges.extend([(0.5 - 0.5 * d, leg), (0.5 + 0.5 * d, leg)]),
                        Carrier::HalfPerSample if k % 2 == 0 => edges.push((1.0 - d, leg)),
                        Carrier::HalfPerSample => edges.push((d, leg)),
                    }
                }
                edges.push((1.0, 3));
                edges.sort_by(|a, b| a.0.total_cmp(&b.0));
                let mut upper = [carrier == Carrier::HalfPerSample && k % 2 == 1; 3];
                let mut now = 0.0;
                for (at, leg) in edges {
                    let Stator { alpha, beta } = clarke(upper.map(|up| if up { RobotAxis::V_DC } else { 0.0 }));
                    let (ud, uq) = rotate_into((alpha, beta), begin + 4.0 * w * 0.5 * (now + at) * RobotAxis::TS);
                    if at > now {
                        let step = ExactStep::new(4, (at - now) * RobotAxis::TS, HeldIn::Stationary).unwrap();
                        i = step.advance(&i, &Drive { ud, uq, w }, &winding);
                    }
                    now = at;
                    if let Some(upper) = upper.get_mut(leg) {
                        *upper = !*upper;
                    }
                }
                x = inverter.advance(x, u, RobotAxis::TS, 6, |_, _| {});
                let error = (x.id - i.id).hypot(x.iq - i.iq);
                assert!(error < 1e-6, "{carrier:?}, sample {k}: {error}");
            }
        }
    }

    // The currents follow those of the mean voltage and meet them at the samples, but for what the rotor turns in a sample
    // (0.08 rad, squared); in between they swing.
    #[test]
    fn the_ripple_vanishes_at_the_samples() {
        let (plant, w) = (round(), 150.0);
        for carrier in CARRIERS {
            let mut inverter = SwitchingInverter::new(&plant, RobotAxis::V_DC, carrier);
            let start = MachineState { id: 0.0, iq: 10.0, w, theta: 0.0 };
            let (mut x, mut mean) = (start, start);
            let (mut at_samples, mut between) = (0f64, 0f64);
            for k in 0..2000 {
                // The voltage of a steady 10 A.
                let u = turned(
                    (-4.0 * w * 4e-3 * 10.0, 4.0 + super::super::SQRT_2_3 * 0.95 * w),
                    4.0 * w * RobotAxis::TS * (k as f64 + 0.5),
                );
                let begin = mean;
                let fine = |t: f64| plant.advance(begin, u, t, 12);
                let mut swing = 0f64;
                x = inverter.advance(x, u, RobotAxis::TS, 6, |t, x| {
                    let mean = fine(t);
                    swing = swing.max((x.id - mean.id).hypot(x.iq - mean.iq));
                });
                mean = fine(RobotAxis::TS);
                // Once the start has died away.
                if k > 1000 {
                    at_samples = at_samples.max((x.id - mean.id).hypot(x.iq - mean.iq));
                    between = between.max(swing);
                }
            }
            println!("{carrier:?}: {at_samples:.4} A at the samples, {between:.3} A between");
            assert!(between > 0.5 && at_samples < 0.005 * between, "{carrier:?}: {at_samples} A, {between} A");
        }
    }

    // With an inductance so large that the current stays, a carrier period loses the mean voltage that the averaged
    // inverter does, for currents large and small, of either sign.
    #[test]
    fn dead_time_takes_what_it_does_from_the_mean() {
        let axis = RobotAxis { ls: 100.0, rs: 1e-9, ..round().axis };
        let lossy = Plant { axis, dead_time: DeadTime { vdt: 2.0, i0: 0.15 }, ..round() };
        for carrier in CARRIERS {
            for (id, iq) in [(8.0, 3.0), (-8.0, 3.0), (0.05, 0.02), (0.2, -0.1)] {
                let start = MachineState { id, iq, w: 0.0, theta: 0.2 };
                let u = Stator { alpha: 40.0, beta: -25.0 };
                let mut inverter = SwitchingInverter::new(&lossy, RobotAxis::V_DC, carrier);
                let (mut x, mut mean) = (start, start);
                for _ in 0..2 {
                    x = inverter.advance(x, u, RobotAxis::TS, 1, |_, _| {});
                    mean = lossy.advance(mean, u, RobotAxis::TS, 6);
                }
                // In volts; the current's own change by 1e-4 A moves the loss by 1e-3 of it.
                let volts = |a: f64, b: f64| (a - b) * 100.0 / (2.0 * RobotAxis::TS);
                let off = volts(x.id, mean.id).hypot(volts(x.iq, mean.iq));
                assert!(off < 4e-3, "{carrier:?}, {id} A, {iq} A: {off} V");
            }
        }
    }

    #[test]
    fn pulses_shorter_than_the_dead_time_are_swallowed() {
        // A dead time of 20 % of the period: at 5 A out of leg a and into the others, a's short pulse is lost.
        let axis = RobotAxis { ls: 100.0, rs: 1e-9, ..round().axis };
        let lossy = Plant { axis, dead_time: DeadTime { vdt: 120.0, i0: 0.15 }, ..round() };
        let start = MachineState { id: 5.0, iq: 0.0, w: 0.0, theta: 0.0 };
        let mut inverter = SwitchingInverter::new(&lossy, RobotAxis::V_DC, Carrier::PerSample);
        // Duties 0.1 (a) and 0.9: below the dead time, and so long that the edges down come late.
        let u = Stator { alpha: -320.0, beta: 0.0 };
        let mut up = 0;
        for _ in 0..5 {
            inverter.advance(start, u, RobotAxis::TS, 6, |_, _| {});
            up += usize::from(inverter.upper[0]);
        }
        assert_eq!(up, 0);
        assert_eq!(inverter.upper, [false, true, true], "the other legs wait for the end of their dead time");
        assert!(inverter.pending[1].is_some_and(|edge| edge.at > 0.0 && !edge.up), "{:?}", inverter.pending);
    }
}
