//! Outliers, removed from a record *before* anything filters it: a filter spreads one bad sample over many good ones.

/// Ratio of the standard deviation of a normal distribution to the median absolute deviation.
const NORMAL_SPREAD: f64 = 1.4826;

/// Replaces by their neighborhood's median the values that lie further than `sigmas` robust standard deviations from it,
/// the neighborhood being `reach` samples to each side (F. R. Hampel, J. Am. Stat. Assoc. 69 (1974) 383-393; the
/// deviation is 1.4826 times the median absolute one). Returns the positions replaced.
///
/// Where more than half of a neighborhood are equal, the deviation is zero: there, a value is left alone unless it
/// differs by more than `floor` (a sensor's step is a good one). What is not a number is never replaced, nor counted.
pub fn hampel(values: &mut [f64], reach: usize, sigmas: f64, floor: f64) -> Vec<usize> {
    let reach = reach.min(values.len());
    let original = values.to_vec();
    let mut replaced = Vec::new();
    let mut window = Vec::with_capacity(2 * reach + 1);
    for (k, value) in values.iter_mut().enumerate() {
        let near = &original[k.saturating_sub(reach)..original.len().min(k.saturating_add(reach + 1))];
        window.clear();
        window.extend(near.iter().filter(|v| !v.is_nan()));
        let Some((center, deviation)) = center_and_deviation(&mut window) else { continue };
        if (*value - center).abs() > (sigmas * deviation).max(floor) {
            *value = center;
            replaced.push(k);
        }
    }
    replaced
}

/// The median, and 1.4826 times the median distance from it: mean and standard deviation of normal values with outliers. The
/// values are overwritten; `None` without any.
pub(crate) fn center_and_deviation(values: &mut [f64]) -> Option<(f64, f64)> {
    let center = median(values)?;
    values.iter_mut().for_each(|value| *value = (*value - center).abs());
    Some((center, NORMAL_SPREAD * median(values)?))
}

/// The median; of an even number the mean of the middle two.
fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    let upper = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    if values.len() % 2 == 1 {
        return Some(upper);
    }
    let lower = values[..middle].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(0.5 * (lower + upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spikes_go_and_the_rest_stays() {
        let clean: Vec<f64> = (0..200).map(|k| (0.05 * k as f64).sin()).collect();
        let mut values = clean.clone();
        for k in [3, 50, 51, 120] {
            values[k] += 10.0;
        }
        values[80] = f64::NAN;
        assert_eq!(hampel(&mut values, 3, 6.0, 0.0), [3, 50, 51, 120]);
        assert!(values[80].is_nan());
        for k in (0..200).filter(|k| *k != 80) {
            assert!((values[k] - clean[k]).abs() < 0.2, "{k}: {}", values[k]);
        }
    }

    #[test]
    fn a_resting_quantized_signal_is_left_alone() {
        let mut values = vec![0.0; 30];
        values[10] = 0.03;
        assert!(hampel(&mut values, 3, 6.0, 0.03).is_empty());
        assert_eq!(hampel(&mut values, 3, 6.0, 0.01), [10]);
    }

    #[test]
    fn nothing_is_fine() {
        assert!(hampel(&mut [], 3, 6.0, 0.0).is_empty());
        assert!(hampel(&mut [f64::NAN], 3, 6.0, 0.0).is_empty());
    }
}
