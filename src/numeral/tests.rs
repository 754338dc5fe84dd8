//! Numbers as a person would write them.

use super::*;

#[test]
fn a_ratio_has_no_unit() {
    assert_eq!(["", "1", "V", "1/s"].map(unit_after), ["", "", " V", " 1/s"]);
}

#[test]
fn numbers_are_rounded() {
    for (value, digits, expected) in [
        (1.150_000_000_000_000_1, EXACT, "1.15"),
        (0.3, 7, "0.3"),
        (0.1 + 0.2, EXACT, "0.3"),
        (1_760_000_000.25, EXACT, "1760000000.25"),
        (0.000_26, 2, "0.00026"),
        (3846.6007, 2, "3847"),
        (9.9996, 4, "10"),
        (2.5e-5, 3, "2.5e-5"),
        (1.76e9, 3, "1.76e9"),
        (-0.0, 3, "0"),
        (f64::NAN, 3, "not a number"),
        (f64::NEG_INFINITY, 3, "-infinite"),
    ] {
        assert_eq!(number(value, digits), expected, "{value:e} to {digits}");
    }
}

/// The value ends where its error has the second digit (JCGM 100:2008, 7.2.6).
#[test]
fn values_end_where_their_errors_do() {
    for (value, error, expected) in [
        (0.630_317_1, 0.000_21, "0.63032"),
        (0.63, 0.0021, "0.6300"),
        (-0.012_8, 0.0139, "-0.013"),
        (0.004_000_461, 1.45e-6, "0.0040005"),
        (0.95, 2.51e-5, "0.950000"),
        (12_345.678, 250.0, "12346"),
        (0.000_3, 0.4, "0.00"),
        (0.0, 0.4, "0"),
        (1.5, f64::NAN, "1.5"),
        (1.5, 0.0, "1.5"),
    ] {
        assert_eq!(resolved(value, error), expected, "{value} with {error}");
    }
    assert_eq!((error_size(0.01).as_str(), error_size(2.513e-5).as_str()), ("0.010", "2.5e-5"));
}

/// A fit that is not perfect is not written as 100 %.
#[test]
fn a_fit_is_told_from_perfect() {
    let fits = [99.997_89, 99.2, 95.5, 100.0, -48_432.0].map(fit);
    assert_eq!(fits, ["99.9979", "99.20", "95.50", "100.0", "-48432"]);
    assert_eq!((rounded(0.015, 0.001), rounded(1.000_02e-3, 0.001)), ("0.015".to_owned(), "0.001".to_owned()));
}

/// Groups of three from five digits on, where the eye no longer counts.
#[test]
fn large_counts_are_grouped() {
    let texts = [0, 999, 4000, 10_000, 123_456, 9_876_543].map(whole);
    assert_eq!(texts, ["0", "999", "4000", "10,000", "123,456", "9,876,543"]);
    let numbers = ["-12646.37", "-999.5", "1.2345e10", "123456.5", "0.12345"].map(grouped);
    assert_eq!(numbers, ["-12,646.37", "-999.5", "1.2345e10", "123,456.5", "0.12345"]);
    assert_eq!(counted(24_841, "sample"), "24,841 samples");
}
