//! The fit as a problem of argmin's own solvers.
//!
//! Cost and gradient serve the line-search and population methods; the dense residual, Jacobian and Gauss-Newton Hessian
//! are made on request only. Where the model cannot be evaluated, or a bound is crossed, the cost is infinite.

use super::{Accumulate, Objective, Weighing};
use crate::optimize::{Infeasible, LeastSquares};
use crate::sweep::Window;
use argmin::core::{CostFunction, Error, Gradient, Hessian, Jacobian, Operator};

impl CostFunction for Objective<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let inside = self.bounds().iter().zip(x).all(|((lower, upper), x)| lower <= x && x <= upper);
        match self.cost_at(x) {
            _ if !inside => Ok(f64::INFINITY),
            Ok(cost) if cost.is_finite() => Ok(cost),
            Ok(_) | Err(Infeasible::Failed(_)) => Ok(f64::INFINITY),
            Err(cancelled) => Err(cancelled.into()),
        }
    }
}

impl Gradient for Objective<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.evaluate(x)?.gradient())
    }
}

impl Operator for Objective<'_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;

    /// The residuals: prediction minus measurement, standardized, times the square root of their weight.
    fn apply(&self, x: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.dense(x, false)?.into_iter().map(|(residual, _)| residual).collect())
    }
}

impl Jacobian for Objective<'_> {
    type Param = Vec<f64>;
    type Jacobian = Vec<Vec<f64>>;

    /// The slopes of the residuals, row by row.
    fn jacobian(&self, x: &Vec<f64>) -> Result<Vec<Vec<f64>>, Error> {
        Ok(self.dense(x, true)?.into_iter().map(|(_, slopes)| slopes).collect())
    }
}

impl Hessian for Objective<'_> {
    type Param = Vec<f64>;
    type Hessian = Vec<Vec<f64>>;

    /// The Gauss-Newton Hessian `J'J`.
    fn hessian(&self, x: &Vec<f64>) -> Result<Vec<Vec<f64>>, Error> {
        let linear = self.evaluate(x)?;
        let mut hessian = vec![vec![0.0; x.len()]; x.len()];
        for (block, columns) in linear.columns() {
            for (a, &i) in columns.iter().enumerate() {
                for (b, &j) in columns.iter().enumerate() {
                    hessian[i][j] += (0..=a.min(b)).map(|row| block.at(row, a) * block.at(row, b)).sum::<f64>();
                }
            }
        }
        Ok(hessian)
    }
}

impl Objective<'_> {
    /// Every weighted residual with its slopes: sample by sample, output by output, the priors last.
    fn dense(&self, x: &[f64], slopes: bool) -> Result<Vec<(f64, Vec<f64>)>, Infeasible> {
        let unknowns = &self.problem.unknowns;
        let width = if slopes { x.len() } else { 0 };
        let make = |experiment: usize| DenseRows {
            weighing: Weighing::new(self, experiment),
            columns: if slopes { unknowns.columns(experiment).collect() } else { vec![] },
            width,
            rows: vec![],
        };
        let mut rows: Vec<(f64, Vec<f64>)> =
            self.gather(x, slopes, make)?.into_iter().flat_map(|dense| dense.rows).collect();
        for (i, slope, error) in unknowns.priors(x) {
            let mut dense = vec![0.0; width];
            if slopes {
                dense[i] = slope;
            }
            rows.push((-error, dense));
        }
        Ok(rows)
    }
}

/// Residuals and slopes of one experiment.
struct DenseRows<'d> {
    weighing: Weighing<'d>,
    columns: Vec<usize>,
    width: usize,
    rows: Vec<(f64, Vec<f64>)>,
}

impl Accumulate for DenseRows<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane)) {
                let [first, second] = self.weighing.rows(window, k, j, lane);
                let row = |(root, error): (f64, f64), values: &[f64]| {
                    let mut dense = vec![0.0; self.width];
                    let values = values.iter().skip(lane).step_by(window.lanes());
                    self.columns.iter().zip(values).for_each(|(&i, value)| dense[i] = root * value);
                    (-error, dense)
                };
                self.rows.push(row(first, window.row(k, j)));
                if window.has_variances() {
                    self.rows.push(row(second, window.variance_row(k, j)));
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.rows.extend(later.rows);
    }
}
