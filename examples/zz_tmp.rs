use greybox::pmsm::{
    drive::*,
    program::Program,
    robot::{Axis, TS},
    *,
};
use greybox::*;
fn main() {
    for ax in [1u8, 2, 3, 4, 5, 6] {
        let axis = Axis::reference(ax).unwrap();
        let sim = Simulation::new(axis).unwrap();
        let program = Program::speed_cycles(&axis, 20, 1.0).unwrap();
        let log = sim.run(&program);
        for c in program.cycles.iter().step_by(4) {
            let rows = &log.rows[c.samples.clone()];
            let mut ins = vec![];
            let mut insx = vec![];
            let mut outs = vec![];
            for p in rows.windows(2) {
                let w = p[1].w;
                let x = 0.5 * 4.0 * w * TS;
                let s = if x.abs() < 1e-6 { 1.0 } else { x.sin() / x };
                let theta = 0.5 * (p[0].theta + p[1].theta);
                ins.push(AngledDrive { ud: p[0].ud, uq: p[0].uq, w, theta });
                insx.push(AngledDrive { ud: p[0].ud / s, uq: p[0].uq / s, w, theta });
                outs.push(Currents { id: p[0].id, iq: p[0].iq });
            }
            let rt = axis.rs + axis.r_cable;
            let e = |a: f64, b: f64| 100. * (a / b - 1.);

            let m = Two(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
            let ex = Experiment::new(&m, Time::Uniform { start: 0.0, step: TS }, ins.clone(), outs.clone()).unwrap();
            let start = FedWinding {
                rs: free(1.5 * axis.rs),
                ls: free(1.2 * axis.ls),
                ke: free(0.9 * axis.ke),
                vdt: free(0.5),
            };
            let f = Fit::new(&m, &ex).parameters(start).run().unwrap();
            println!(
                "{ax} {:.0} two R {:.3} L {:.3} Ke {:.4} vdt {:.4} iters {} {:?}",
                c.speed,
                e(f.parameters.rs, rt),
                e(f.parameters.ls, axis.ls),
                e(f.parameters.ke, axis.ke),
                f.parameters.vdt,
                f.iterations,
                f.outcome
            );
            let m = Meas(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
            let li: Vec<Lost> = rows
                .windows(2)
                .zip(&ins)
                .map(|(p, u)| {
                    let i = Currents { id: 0.5 * (p[0].id + p[1].id), iq: 0.5 * (p[0].iq + p[1].iq) };
                    let l = dead_time(&i, 0.15, 4.0 * u.theta);
                    Lost { ud: u.ud, uq: u.uq, w: u.w, ld: l.0, lq: l.1 }
                })
                .collect();
            let ex = Experiment::new(&m, Time::Uniform { start: 0.0, step: TS }, li, outs.clone()).unwrap();
            let f = Fit::new(&m, &ex).parameters(start).run().unwrap();
            println!(
                "{ax} {:.0} meas R {:.3} L {:.3} Ke {:.4} vdt {:.4} iters {} {:?}",
                c.speed,
                e(f.parameters.rs, rt),
                e(f.parameters.ls, axis.ls),
                e(f.parameters.ke, axis.ke),
                f.parameters.vdt,
                f.iterations,
                f.outcome
            );
        }
    }
}
signals! { struct Lost { ud: "V", uq: "V", w: "rad/s", ld: "", lq: "" } }
struct Two(ExactStep);
impl Model for Two {
    type State = Currents;
    type Input = AngledDrive;
    type Output = Currents;
    type Parameters = FedWinding;
    const KIND: Kind = Kind::Discrete;
    #[inline]
    fn next<S: Scalar>(&self, _t: f64, x: &Currents<S>, u: &AngledDrive<S>, p: &FedWinding<S>) -> Currents<S> {
        let w = Winding { rs: p.rs, ls: p.ls, ke: p.ke };
        let th = u.theta * 4.0;
        let step = |i: &Currents<S>| {
            let l = dead_time(i, S::from(0.15), th);
            self.0.advance(x, &Drive { ud: u.ud - p.vdt * l.0, uq: u.uq - p.vdt * l.1, w: u.w }, &w)
        };
        let n = step(x);
        step(&Currents { id: (n.id + x.id) * 0.5, iq: (n.iq + x.iq) * 0.5 })
    }
    #[inline]
    fn output<S: Scalar>(&self, _t: f64, x: &Currents<S>, _u: &AngledDrive<S>, _p: &FedWinding<S>) -> Currents<S> {
        *x
    }
}
struct Meas(ExactStep);
impl Model for Meas {
    type State = Currents;
    type Input = Lost;
    type Output = Currents;
    type Parameters = FedWinding;
    const KIND: Kind = Kind::Discrete;
    #[inline]
    fn next<S: Scalar>(&self, _t: f64, x: &Currents<S>, u: &Lost<S>, p: &FedWinding<S>) -> Currents<S> {
        self.0.advance(
            x,
            &Drive { ud: u.ud - p.vdt * u.ld, uq: u.uq - p.vdt * u.lq, w: u.w },
            &Winding { rs: p.rs, ls: p.ls, ke: p.ke },
        )
    }
    #[inline]
    fn output<S: Scalar>(&self, _t: f64, x: &Currents<S>, _u: &Lost<S>, _p: &FedWinding<S>) -> Currents<S> {
        *x
    }
}
