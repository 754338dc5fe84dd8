//! [`Band`]: what follows from the parameters and the length of an interval, for lengths that are close to each other.

use core::f64::consts::PI;

/// Bands per factor of two of the length.
const BANDS: f64 = 4.0;
/// Nodes of the polynomial of a band. Twelve interpolate exponential decays of any rate, and their integrals, to some 1e-15.
pub(super) const NODES: usize = 12;

/// Numbers by their polynomial in the length, through Chebyshev's points.
pub(super) struct Band {
    /// Each with its weight in the barycentric formula (J.-P. Berrut, L. N. Trefethen, SIAM Review 46 (2004) 501-517).
    nodes: Vec<Node>,
}

struct Node {
    length: f64,
    weight: f64,
    numbers: Vec<f64>,
}

impl Band {
    /// The number of the band of a length.
    pub fn of(length: f64) -> i32 {
        (length.log2() * BANDS).floor() as i32
    }

    /// The lengths at which it begins and ends.
    pub fn bounds(number: i32) -> [f64; 2] {
        [number, number.saturating_add(1)].map(|number| (f64::from(number) / BANDS).exp2())
    }

    pub fn new(number: i32, numbers: impl Fn(f64) -> Vec<f64>) -> Self {
        let [begin, end] = Band::bounds(number);
        let node = |i: usize| {
            let (sin, cos) = (PI * (i as f64 + 0.5) / NODES as f64).sin_cos();
            let length = 0.5 * (begin + end) + 0.5 * (end - begin) * cos;
            Node { length, weight: if i.is_multiple_of(2) { sin } else { -sin }, numbers: numbers(length) }
        };
        Band { nodes: (0..NODES).map(node).collect() }
    }

    /// Those of a length.
    pub fn numbers(&self, length: f64) -> Vec<f64> {
        if let Some(node) = self.nodes.iter().find(|node| node.length == length) {
            return node.numbers.clone();
        }
        let part = |node: &Node| node.weight / (length - node.length);
        let whole: f64 = self.nodes.iter().map(part).sum();
        let mut found = vec![0.0; self.nodes.first().map_or(0, |node| node.numbers.len())];
        for node in &self.nodes {
            let part = part(node) / whole;
            found.iter_mut().zip(&node.numbers).for_each(|(sum, number)| *sum += part * number);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decays from far slower to far faster than the interval, their integral and its mean: to the rounding of a sum of twelve numbers.
    #[test]
    fn decays_of_any_rate() {
        for exponent in -20..40 {
            let rate = 0.1 * 2f64.powf(0.5 * f64::from(exponent));
            let numbers = |h: f64| {
                let left = (-rate * h).exp();
                let integral = -(-rate * h).exp_m1() / rate;
                vec![left, h * left, integral * rate.max(1.0), integral / h]
            };
            for number in [-3, 0, 7] {
                let (band, [begin, end]) = (Band::new(number, numbers), Band::bounds(number));
                for at in 0..50 {
                    let h = begin + (end - begin) * f64::from(at) / 49.0;
                    assert!(at == 49 || Band::of(h) == number, "{number} {at}");
                    for (found, exact) in band.numbers(h).iter().zip(numbers(h)) {
                        assert!((found - exact).abs() < 1e-14 * end.max(1.0), "{rate} {h}: {found} {exact}");
                    }
                }
            }
        }
    }
}
