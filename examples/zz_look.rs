use greybox::pmsm::{Currents, Drive, Surface, Winding};
use greybox::*;
fn main() {
    let model = Surface::new(4).unwrap();
    for n in [200usize, 2000, 16384, 200_000] {
        let level = |k: usize, h: usize, s: u64| {
            let z = ((k / h) as u64).wrapping_mul(0x9e3779b97f4a7c15 ^ s).wrapping_add(s);
            let z = (z ^ (z >> 31)).wrapping_mul(0xbf58476d1ce4e5b9);
            ((z >> 11) as f64) / (1u64 << 53) as f64 - 0.5
        };
        let inputs: Vec<Drive> = (0..n)
            .map(|k| Drive {
                ud: 6.0 * level(k, 40, 1),
                uq: 10.0 + 10.0 * level(k, 60, 2),
                w: 12.0 + 10.0 * level(k, 400, 3) + 0.01 * level(k, 1, 9),
            })
            .collect();
        let truth = Winding { rs: 0.6, ls: 4e-3, ke: 0.5 };
        let run = simulate(
            &model,
            &truth,
            &Currents { id: 0.0, iq: 0.0 },
            Time::Uniform { start: 0.0, step: 1.26e-4 },
            &inputs,
        )
        .unwrap();
        let record = run.with_noise(Currents { id: 0.05, iq: 0.05 }, 7).experiment(&model).unwrap();
        let median = |f: &mut dyn FnMut()| {
            let mut t: Vec<f64> = (0..31)
                .map(|_| {
                    let b = cpu_time::ProcessTime::now();
                    f();
                    b.elapsed().as_secs_f64()
                })
                .collect();
            t.sort_by(f64::total_cmp);
            t[5]
        };
        let small = if n > 16384 { record.slice(0..16384).unwrap() } else { record.clone() };
        for _ in 0..3 {
            let look = median(&mut || {
                for _ in 0..10 {
                    std::hint::black_box(small.inspect());
                }
            }) / 10.0;
            let fit = median(&mut || {
                std::hint::black_box(
                    Fit::new(&model, &record)
                        .parameters(Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.8) })
                        .run()
                        .unwrap(),
                );
            });
            println!("{n}: look {look:.2e} fit {fit:.2e} part {:.2} %", 100.0 * look / fit);
        }
    }
}
