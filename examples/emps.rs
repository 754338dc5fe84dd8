use greybox::models::{Axis, Guided, GuidedMotion, Positioning, PositioningLoop};
use greybox::{Experiment, Fit, Hold, Rk4, free, fixed};
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap();
    for lag in [0.6e-3, 1.1e-3, 1.6e-3] {
    for width in [2e-4, 5e-4, 1e-3] {
    for (name, noise) in [("vir", Some(Guided{qm: 1e3, vir: 0.05})), ("q", Some(Guided{qm: 1e-5, vir: 1e3}))] {
        let model = PositioningLoop { axis: Positioning { width, ..Positioning::EMPS }, lag, ..PositioningLoop::EMPS };
        let record = Experiment::from_csv(&model, &path)?.hold(Hold::First).initial(GuidedMotion { q: free(0.0), v: fixed(0.0), vm: fixed(0.0) });
        let fit = Fit::new(&model, &record).parameters(Axis { m: free(80.0), fv: free(150.0), fc: free(15.0), offset: free(0.0) });
        let fit = match noise { Some(n) => fit.noise(n), None => fit };
        let _ = Rk4 { substeps: 1 };
        let e = fit.run()?;
        let p = e.parameters;
        let r = [95.1089, 203.5034, 20.3935, -3.1648];
        println!("{lag} {width} {name} M {:.2} Fv {:.2} Fc {:.2} off {:.2} %  rmse {:?}", 100.*(p.m/r[0]-1.), 100.*(p.fv/r[1]-1.), 100.*(p.fc/r[2]-1.), 100.*(p.offset/r[3]-1.), (e.quality.qm.rmse, e.quality.vir.rmse));
        let pr = e.predict_own(&model, &record, 0).unwrap()?;
        let num: f64 = pr.residuals.iter().map(|r| r.vir*r.vir).sum::<f64>().sqrt();
        let den: f64 = record.outputs().iter().map(|r| r.vir*r.vir).sum::<f64>().sqrt();
        println!("    force error {:.3} %  iterations {} {:.2}s {}", 100.*num/den, e.iterations, e.seconds, e.method.integrator);
    }}}
    Ok(())
}
