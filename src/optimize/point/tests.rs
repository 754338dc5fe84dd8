//! Points of a search: bounds, steps, ends.

use super::*;
use crate::information::Information;

/// Rows `(slope, residual)` of one unknown.
pub fn linear(rows: &[(f64, f64)]) -> Linearization {
    let mut information = Information::new(1);
    rows.iter().for_each(|&(slope, residual)| information.absorb_row(&[slope], residual));
    Linearization::new(0.5 * information.residual_at_zero(), 1, vec![information])
}

pub fn at(x: f64, linear: Linearization) -> Point {
    Point::new(vec![x], linear, &Domain::default(), &Seen::default()).unwrap()
}

/// Residuals 3, which a step of 3 takes away, and 4: the cost 12.5 would fall by 4.5.
fn far() -> Linearization {
    linear(&[(1.0, 3.0), (0.0, 4.0)])
}

/// One thousandth of a residual of 4: of the cost 8, a step would gain 5e-7.
fn near() -> Linearization {
    linear(&[(1.0, 1e-3), (0.0, 4.0)])
}

/// Sums of place and limit miss these bounds in the last digit.
#[test]
fn steps_end_on_their_bounds() {
    for (x, bound) in [(0.2, 0.9), (-2.3, 2.4), (0.7, 0.1), (2.0, -0.4)] {
        assert_ne!(x + (bound - x), bound);
        let domain = Domain { bounds: vec![if bound > x { (-9.0, bound) } else { (bound, 9.0) }], ..Domain::default() };
        let point = Point::new(vec![x], linear(&[(1.0, 1.0)]), &domain, &Seen::default()).unwrap();
        assert_eq!([point.towards(&[bound - x]), point.towards(&[3.0 * (bound - x)])], [vec![bound], vec![bound]]);
        assert_eq!(point.towards(&[0.5 * (bound - x)]), [x + 0.5 * (bound - x)]);
    }
}

/// A residual of 3 asks for a step up, one of -3 for a step down: where a bound is in the way the unknown is held, and its slope
/// no longer counts.
#[test]
fn what_its_bound_holds() {
    let (below, above) = ((-9.0, 0.0), (0.0, 9.0));
    for (bound, residual, held) in [(below, 3.0, true), (above, 3.0, false), (below, -3.0, false), (above, -3.0, true)]
    {
        let domain = Domain { bounds: vec![bound], ..Domain::default() };
        let point = Point::new(vec![0.0], linear(&[(1.0, residual)]), &domain, &Seen::default()).unwrap();
        assert_eq!((point.held[0], point.cosine()), (held, if held { 0.0 } else { 1.0 }), "{bound:?} {residual}");
    }
}

/// Residuals 1e-3 and 4 in the columns of two unknowns of size 50. The slope of the second counts as long as a change of 50 moves the residual by more than
/// its last digit, `4 * 2^-52`, and always where the unknown is zero, so that its size is not known.
#[test]
fn slopes_of_what_changes_nothing_do_not_count() {
    let cosine = |norm: f64, x: f64| {
        let mut information = Information::new(2);
        information.absorb_row(&[1.0, 0.0], 1e-3);
        information.absorb_row(&[0.0, norm], 4.0);
        let linear = Linearization::new(0.5 * information.residual_at_zero(), 2, vec![information]);
        Point::new(vec![50.0, x], linear, &Domain::default(), &Seen::default()).unwrap().cosine()
    };
    for (norm, x, counts) in [(2e-17, 50.0, true), (1e-17, 50.0, false), (1e-17, 0.0, true)] {
        let expected = if counts { 1.0 } else { 2.5e-4 };
        assert!((cosine(norm, x) - expected).abs() < 1e-7, "{norm} {x}: {}", cosine(norm, x));
    }
}

#[test]
fn what_the_cost_resolves() {
    assert_eq!(at(0.0, far()).resolution(), 12.5 * 1e-13);
    // Data of norm 1e6, rounded to 2^-52 of themselves; ten roundings, of a residual whose norm is 5.
    let rounding = at(0.0, far().with_data_norm(1e6)).rounding();
    assert!((rounding / (10.0 * f64::EPSILON * 1e6 / 5.0) - 1.0).abs() < 1e-14, "{rounding}");
    assert_eq!(at(0.0, far()).rounding(), 0.0);
    assert_eq!(at(0.0, linear(&[(1.0, 0.0)]).with_data_norm(1e6)).rounding(), 0.0);
}

/// A cost that logarithms of variances have made negative is measured by its squares; a residual is rounding within ten roundings of
/// an unknown of 6, unless the data are so small that it is more than 1e-10 of them.
#[test]
fn sizes_and_rounding_of_a_residual() {
    let mut likelihood = far();
    likelihood.cost = -3.0;
    assert!((at(0.0, likelihood.clone()).cost_size() - 12.5).abs() < 1e-12);
    likelihood.cost = -30.0;
    assert_eq!(at(0.0, likelihood).cost_size(), 30.0);
    let ended = |linear: Linearization| at(6.0, linear).ended(&Stop::default());
    let roundings = |count: f64| linear(&[(1.0, count * 6.0 * f64::EPSILON)]);
    assert_eq!(ended(linear(&[(1.0, 0.0)])), Some(Outcome::Exact));
    assert_eq!(ended(roundings(9.9)), Some(Outcome::Exact));
    assert_ne!(ended(roundings(10.1)), Some(Outcome::Exact));
    let size = 9.9 * 6.0 * f64::EPSILON;
    assert_eq!(ended(roundings(9.9).with_data_norm(1.1e10 * size)), Some(Outcome::Exact));
    assert_ne!(ended(roundings(9.9).with_data_norm(0.9e10 * size)), Some(Outcome::Exact));
}

/// A gradient cosine of 2.5e-7 is that of ten roundings of data of norm 4.5e8 in a residual of 4.
#[test]
fn a_gradient_of_rounding() {
    let is_flat = |norm: f64| at(6.0, linear(&[(1.0, 1e-6), (0.0, 4.0)]).with_data_norm(norm)).is_flat();
    assert_eq!([is_flat(4.6e8), is_flat(4.4e8)], [true, false]);
}

/// The full step is `sqrt(2 * 4.5 / 25 * 2)` standard errors long, of two rows.
#[test]
fn a_search_without_a_lower_cost() {
    let stuck = |linear: Linearization, noise: f64, rough: bool| at(6.0, linear).stuck(2, noise, rough);
    let Outcome::Stalled { gradient, step, failed: 2 } = stuck(far(), 0.35, false) else { panic!() };
    // The cosine of 3 : 4 : 5; 3 of 6 and of a standard error `sqrt(25 / 2)`.
    assert!((gradient - 0.6).abs() < 1e-14 && (step - 3.0 / (6.0 + 12.5f64.sqrt())).abs() < 1e-14);
    let Outcome::Rough { noise, errors } = stuck(far(), 0.37, false) else { panic!() };
    assert!(noise == 0.37 && (errors - 0.72f64.sqrt()).abs() < 1e-14, "{noise} {errors}");
    let Outcome::Rough { noise, .. } = stuck(far(), 0.0, true) else { panic!() };
    assert!((noise - 0.36).abs() < 1e-14, "{noise}");
    // The gain 5e-7 / 8 is below ten roundings of data of norm 1.2e8 in a residual of 4, and above those of 1e8.
    assert!(matches!(stuck(near().with_data_norm(1.2e8), 0.0, false), Outcome::Rough { .. }));
    assert!(matches!(stuck(near().with_data_norm(1e8), 0.0, false), Outcome::Stalled { .. }));
    assert_eq!(stuck(near().with_data_norm(1e11), 0.0, false), Outcome::Exact);
    // A gradient cosine of 2.5e-7.
    assert!(matches!(stuck(linear(&[(1.0, 1e-6), (0.0, 4.0)]), 0.0, false), Outcome::LimitOfPrecision { .. }));
}

/// A thousandth of its size off the bound, and of the distance to the other bound or of one where that is less.
#[test]
fn points_inside_of_a_bound() {
    let inside = |x: f64, bounds: (f64, f64), size: Option<f64>, slope: f64| {
        let domain = Domain { bounds: vec![bounds], ..Domain::default() };
        Point::new(vec![x], linear(&[(slope, 1.0)]), &domain, &Seen::default())
            .unwrap()
            .inside(&Seen::new(&[x], &[size]))
            .concat()
    };
    assert_eq!(inside(0.0, (0.0, 9.0), None, 0.0), [1e-3]);
    assert_eq!(inside(0.0, (-9.0, 0.0), None, 0.0), [-1e-3]);
    assert_eq!(inside(0.0, (0.0, 0.5), None, 0.0), [0.5e-3]);
    assert_eq!(inside(0.0, (0.0, 9.0), Some(0.25), 0.0), [0.25e-3]);
    assert_eq!(inside(0.0, (-9.0, 0.0), Some(0.25), 0.0), [-0.25e-3]);
    assert!(inside(0.0, (0.0, 9.0), None, 1.0).is_empty() && inside(1.0, (0.0, 9.0), None, 0.0).is_empty());
}

/// A hundredth of the size to either side.
#[test]
fn points_beside() {
    let beside = |x: f64, size: Option<f64>| at(x, far()).beside(&[-4.0], &Seen::new(&[x], &[size]));
    assert_eq!(beside(6.0, None), [vec![6.0 - 0.06], vec![6.0 + 0.06]]);
    assert_eq!(beside(0.0, Some(2.0)), [vec![-0.02], vec![0.02]]);
    assert!(beside(0.0, None).is_empty());
}

/// Columns of lengths 2 and 4 that are one: nothing changes where the first unknown moves twice as far as the second, against it,
/// unless one of them is on a bound, and stays there.
#[test]
fn a_direction_without_influence() {
    let mut information = Information::new(2);
    information.absorb_row(&[2.0, 4.0], 1.0);
    let linear = Linearization::new(0.5, 2, vec![information]);
    let of = |bounds: Vec<(f64, f64)>| {
        Point::new(vec![1.0; 2], linear.clone(), &Domain { bounds, ..Domain::default() }, &Seen::default())
            .unwrap()
            .without_influence()
    };
    let (inside, lower, upper) = ((0.0, 9.0), (1.0, 9.0), (-9.0, 1.0));
    for found in [of(vec![]), of(vec![inside; 2])] {
        assert!(found.len() == 1 && (found[0][0] / found[0][1] + 2.0).abs() < 1e-12, "{found:?}");
    }
    for bounds in [[lower, inside], [upper, inside], [inside, lower], [inside, upper], [lower, upper]] {
        assert!(of(bounds.to_vec()).is_empty(), "{bounds:?}");
    }
}

/// A step would gain 5e-7 of the cost 8.
#[test]
fn a_cost_that_no_step_lowers() {
    let ended = |cost: f64| at(6.0, near()).ended(&Stop { step: 0.0, gradient: 0.0, cost, ..Stop::default() });
    assert_eq!(ended(6.25e-8 * 0.999), None);
    assert!(matches!(ended(6.25e-8 * 1.001), Some(Outcome::CostUnchanged { decrease }) if decrease < 6.2501e-8));
    assert_eq!(ended(0.0), None);
    // Nothing left to gain, and no tolerance given.
    let done = at(6.0, linear(&[(1.0, 0.0), (0.0, 4.0)]));
    assert!(matches!(done.ended(&Stop::default()), Some(Outcome::Converged { .. })));
}

#[test]
fn a_full_step_within_the_tolerance() {
    let end = |linear: Linearization, noise: f64| {
        within_tolerance(&[6.0], linear, &Domain::default(), |x| {
            assert!((x[0] - 9.0).abs() < 1e-12 || (x[0] - 6.001).abs() < 1e-12, "{x:?}");
            noise
        })
    };
    let Some(Outcome::Rough { noise, errors }) = end(far(), 4.5) else { panic!() };
    assert!((noise - 0.36).abs() < 1e-14 && (errors - 0.72f64.sqrt()).abs() < 1e-14, "{noise} {errors}");
    assert_eq!(end(far(), 4.4), None);
    // A step of 3.5e-4 standard errors is negligible whatever it gains.
    assert!(matches!(end(near(), 0.0), Some(Outcome::Rough { noise: 0.0, errors }) if errors < 4e-4));
    // A cost of zero has no part.
    assert_eq!(within_tolerance(&[6.0], linear(&[(1.0, 0.0)]), &Domain::default(), |_| 1.0), None);
}

/// A logarithm is held where its column has shrunk to nothing and the cost falls along with it; not where the column has not
/// shrunk, as on a plateau from which it grows, not where the cost rises, and nothing but a logarithm.
#[test]
fn a_logarithm_without_influence() {
    let held = |slope: f64, largest: f64, residual: f64, logarithm: bool| {
        let domain = Domain { logarithms: vec![logarithm], ..Domain::default() };
        let mut seen = Seen::new(&[-20.0], &[Some(1.0)]);
        seen.add(&[-20.0], &[largest]);
        Point::new(vec![-20.0], linear(&[(slope, residual), (0.0, 1.0)]), &domain, &seen).unwrap().held[0]
    };
    assert!(held(0.9e-9, 1.0, -0.1, true));
    assert!(!held(0.9e-9, 1.0, 0.1, true), "the cost rises");
    assert!(!held(1.1e-9, 1.0, -0.1, true), "it has influence");
    assert!(!held(0.9e-9, 0.9e-9, -0.1, true), "it has not shrunk");
    assert!(!held(0.9e-9, 1.0, -0.1, false), "no logarithm");
}
