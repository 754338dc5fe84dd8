//! Problems of J. J. More, B. S. Garbow and K. E. Hillstrom, "Testing Unconstrained Optimization Software", ACM TOMS 7
//! (1981) 17-41, with their numbers there. The costs are sums of squares as printed; minimizers where they are unique.

use greybox::optimize::{Infeasible, LeastSquares, Linearization};
use greybox::{Dual, Scalar, information::Information};

/// Enough slopes for the widest problem.
pub type D = Dual<11>;

pub struct Problem {
    pub name: &'static str,
    pub start: &'static [f64],
    pub residuals: fn(&[D]) -> Vec<D>,
    /// Sums of squares at the minima, the global one first.
    pub minima: &'static [f64],
    /// The global minimizer, where it is unique and known.
    pub minimizer: Option<&'static [f64]>,
    /// Lower and upper bounds, if any.
    pub bounds: &'static [(f64, f64)],
}

impl Problem {
    pub fn evaluate(&self, x: &[f64]) -> Vec<D> {
        let variables: Vec<D> = x.iter().enumerate().map(|(i, &x)| D::variable(x, i)).collect();
        (self.residuals)(&variables)
    }
}

impl LeastSquares for Problem {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        let mut information = Information::new(x.len());
        let mut cost = 0.0;
        for residual in self.evaluate(x) {
            if !(residual.value.is_finite() && residual.slopes.iter().all(|slope| slope.is_finite())) {
                return Err(Infeasible::Failed("a residual is not finite".to_owned()));
            }
            cost += 0.5 * residual.value * residual.value;
            information.absorb_row(&residual.slopes[..x.len()], -residual.value);
        }
        Ok(Linearization::new(cost, x.len(), vec![information]))
    }

    /// By a difference with the residuals a tenth of the direction away.
    fn curvature(&self, x: &[f64], along: &[f64]) -> Option<Result<Linearization, Infeasible>> {
        const FAR: f64 = 0.1;
        let far: Vec<f64> = x.iter().zip(along).map(|(x, along)| x + FAR * along).collect();
        let mut information = Information::new(x.len());
        for (here, far) in self.evaluate(x).into_iter().zip(self.evaluate(&far)) {
            let slope: f64 = here.slopes.iter().zip(along).map(|(slope, along)| slope * along).sum();
            let second = 2.0 / (FAR * FAR) * (far.value - here.value - FAR * slope);
            if !(second.is_finite() && here.slopes.iter().all(|slope| slope.is_finite())) {
                return Some(Err(Infeasible::Failed("a residual is not finite".to_owned())));
            }
            information.absorb_row(&here.slopes[..x.len()], -second);
        }
        Some(Ok(Linearization::new(0.0, x.len(), vec![information])))
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.to_vec()
    }
}

fn c(value: f64) -> D {
    D::constant(value)
}

/// `f(1), f(2), ..., f(m)`.
fn rows(m: u32, f: impl Fn(f64) -> D) -> Vec<D> {
    (1..=m).map(|i| f(f64::from(i))).collect()
}

fn against(y: &[f64], f: impl Fn(f64) -> D) -> Vec<D> {
    y.iter().enumerate().map(|(i, &y)| f((i + 1) as f64) - y).collect()
}

const BARD: [f64; 15] = [0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39];
const GAUSSIAN: [f64; 15] = [
    0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989, 0.3521, 0.2420, 0.1295, 0.0540, 0.0175, 0.0044,
    0.0009,
];
const MEYER: [f64; 16] = [
    34780.0, 28610.0, 23650.0, 19630.0, 16370.0, 13720.0, 11540.0, 9744.0, 8261.0, 7030.0, 6005.0, 5147.0, 4427.0,
    3820.0, 3307.0, 2872.0,
];
const KOWALIK: [(f64, f64); 11] = [
    (0.1957, 4.0),
    (0.1947, 2.0),
    (0.1735, 1.0),
    (0.1600, 0.5),
    (0.0844, 0.25),
    (0.0627, 0.167),
    (0.0456, 0.125),
    (0.0342, 0.1),
    (0.0323, 0.0833),
    (0.0235, 0.0714),
    (0.0246, 0.0625),
];
const OSBORNE_1: [f64; 33] = [
    0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751, 0.718, 0.685, 0.658, 0.628, 0.603,
    0.580, 0.558, 0.538, 0.522, 0.506, 0.490, 0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.420, 0.414, 0.411,
    0.406,
];
const OSBORNE_2: [f64; 65] = [
    1.366, 1.191, 1.112, 1.013, 0.991, 0.885, 0.831, 0.847, 0.786, 0.725, 0.746, 0.679, 0.608, 0.655, 0.616, 0.606,
    0.602, 0.626, 0.651, 0.724, 0.649, 0.649, 0.694, 0.644, 0.624, 0.661, 0.612, 0.558, 0.533, 0.495, 0.500, 0.423,
    0.395, 0.375, 0.372, 0.391, 0.396, 0.405, 0.428, 0.429, 0.523, 0.562, 0.607, 0.653, 0.672, 0.708, 0.633, 0.668,
    0.645, 0.632, 0.591, 0.559, 0.597, 0.625, 0.739, 0.710, 0.729, 0.720, 0.636, 0.581, 0.428, 0.292, 0.162, 0.098,
    0.054,
];

macro_rules! problem {
    ($name:literal, $start:expr, $minima:expr, $minimizer:expr, $residuals:expr) => {
        Problem {
            name: $name,
            start: &$start,
            residuals: $residuals,
            minima: &$minima,
            minimizer: $minimizer,
            bounds: &[],
        }
    };
}

pub const PROBLEMS: &[Problem] = &[
    problem!("1 Rosenbrock", [-1.2, 1.0], [0.0], Some(&[1.0, 1.0]), |x| vec![(x[1] - x[0] * x[0]) * 10.0, -x[0] + 1.0]),
    problem!("2 Freudenstein and Roth", [0.5, -2.0], [0.0, 48.984_253_679_240_01], Some(&[5.0, 4.0]), |x| vec![
        x[0] - 13.0 + ((-x[1] + 5.0) * x[1] - 2.0) * x[1],
        x[0] - 29.0 + ((x[1] + 1.0) * x[1] - 14.0) * x[1]
    ]),
    problem!(
        "3 Powell badly scaled",
        [0.0, 1.0],
        [0.0],
        Some(&[1.098_159_329_699_76e-5, 9.106_146_739_867_2]),
        |x| vec![x[0] * x[1] * 1e4 - 1.0, (-x[0]).exp() + (-x[1]).exp() - 1.0001]
    ),
    problem!("4 Brown badly scaled", [1.0, 1.0], [0.0], Some(&[1e6, 2e-6]), |x| vec![
        x[0] - 1e6,
        x[1] - 2e-6,
        x[0] * x[1] - 2.0
    ]),
    problem!("5 Beale", [1.0, 1.0], [0.0], Some(&[3.0, 0.5]), |x| {
        [1.5, 2.25, 2.625].iter().zip(1..).map(|(&y, i)| -x[0] * (-x[1].powi(i) + 1.0) + y).collect()
    }),
    problem!("6 Jennrich and Sampson", [0.3, 0.4], [124.362_182_355_615], Some(&[0.257_825, 0.257_825]), |x| {
        rows(10, |i| -(x[0] * i).exp() - (x[1] * i).exp() + 2.0 + 2.0 * i)
    }),
    problem!("7 Helical valley", [-1.0, 0.0, 0.0], [0.0], Some(&[1.0, 0.0, 0.0]), |x| {
        let turn = x[1].atan2(x[0]) / std::f64::consts::TAU;
        vec![(x[2] - turn * 10.0) * 10.0, (x[0].hypot(x[1]) - 1.0) * 10.0, x[2]]
    }),
    problem!(
        "8 Bard",
        [1.0, 1.0, 1.0],
        [8.214_877_306_578_96e-3, 17.428_69],
        Some(&[0.082_41, 1.133_04, 2.343_69]),
        |x| {
            against(&BARD, |u| {
                let (v, w) = (16.0 - u, u.min(16.0 - u));
                x[0] + c(u) / (x[1] * v + x[2] * w)
            })
        }
    ),
    problem!("9 Gaussian", [0.4, 1.0, 0.0], [1.127_932_769_618_72e-8], Some(&[0.398_956_1, 1.000_019_1, 0.0]), |x| {
        against(&GAUSSIAN, |i| x[0] * (-x[1] * (-x[2] + (8.0 - i) / 2.0).powi(2) / 2.0).exp())
    }),
    problem!(
        "10 Meyer",
        [0.02, 4000.0, 250.0],
        [87.945_855_170_395_8],
        Some(&[5.609_64e-3, 6181.346, 345.223_6]),
        |x| { against(&MEYER, |i| x[0] * (x[1] / (x[2] + 45.0 + 5.0 * i)).exp()) }
    ),
    problem!("12 Box", [0.0, 10.0, 20.0], [0.0], None, |x| {
        rows(10, |i| {
            let t = 0.1 * i;
            (-x[0] * t).exp() - (-x[1] * t).exp() - x[2] * ((-t).exp() - (-10.0 * t).exp())
        })
    }),
    problem!("13 Powell singular", [3.0, -1.0, 0.0, 1.0], [0.0], Some(&[0.0, 0.0, 0.0, 0.0]), |x| vec![
        x[0] + x[1] * 10.0,
        (x[2] - x[3]) * 5f64.sqrt(),
        (x[1] - x[2] * 2.0).powi(2),
        (x[0] - x[3]).powi(2) * 10f64.sqrt()
    ]),
    problem!("14 Wood", [-3.0, -1.0, -3.0, -1.0], [0.0], Some(&[1.0, 1.0, 1.0, 1.0]), |x| vec![
        (x[1] - x[0] * x[0]) * 10.0,
        -x[0] + 1.0,
        (x[3] - x[2] * x[2]) * 90f64.sqrt(),
        -x[2] + 1.0,
        (x[1] + x[3] - 2.0) * 10f64.sqrt(),
        (x[1] - x[3]) / 10f64.sqrt()
    ]),
    problem!(
        "15 Kowalik and Osborne",
        [0.25, 0.39, 0.415, 0.39],
        [3.075_056_038_492e-4, 1.027_34e-3],
        Some(&[0.192_807, 0.191_282, 0.123_057, 0.136_062]),
        |x| {
            let row = |&(y, u): &(f64, f64)| x[0] * (x[1] * u + u * u) / (x[2] * u + x[3] + u * u) - y;
            KOWALIK.iter().map(row).collect()
        }
    ),
    problem!(
        "16 Brown and Dennis",
        [25.0, 5.0, -5.0, -1.0],
        [85_822.201_626_356_3],
        Some(&[-11.594_44, 13.203_63, -0.403_439_5, 0.236_778_8]),
        |x| {
            rows(20, |i| {
                let t = i / 5.0;
                (x[0] + x[1] * t - t.exp()).powi(2) + (x[2] + x[3] * t.sin() - t.cos()).powi(2)
            })
        }
    ),
    problem!(
        "17 Osborne 1",
        [0.5, 1.5, -1.0, 0.01, 0.02],
        [5.464_894_697e-5],
        Some(&[0.375_410, 1.935_847, -1.464_687, 0.012_867_5, 0.022_122_7]),
        |x| {
            against(&OSBORNE_1, |i| {
                let t = 10.0 * (i - 1.0);
                x[0] + x[1] * (-x[3] * t).exp() + x[2] * (-x[4] * t).exp()
            })
        }
    ),
    problem!(
        "19 Osborne 2",
        [1.3, 0.65, 0.65, 0.7, 0.6, 3.0, 5.0, 7.0, 2.0, 4.5, 5.5],
        [4.013_773_629e-2],
        None,
        |x| {
            against(&OSBORNE_2, |i| {
                let t = 0.1 * (i - 1.0);
                let peak = |k: usize| x[k] * (-x[k + 4] * (-x[k + 7] + t).powi(2)).exp();
                x[0] * (-x[4] * t).exp() + peak(1) + peak(2) + peak(3)
            })
        }
    ),
];
