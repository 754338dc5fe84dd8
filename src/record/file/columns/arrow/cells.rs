//! Arrow arrays as cells.

use super::Cells;
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, Decimal32Type, Decimal64Type, Decimal128Type, DurationMicrosecondType,
    DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float16Type, Float32Type, Float64Type,
    Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType, Time32SecondType, Time64MicrosecondType,
    Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType,
    TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef};
use arrow_schema::{DataType, TimeUnit};

/// Adds the values of an array to the cells of its column. Cells that are texts take whole numbers, too.
///
/// # Errors
/// What the array holds, where that cannot be cells.
pub(super) fn append(cells: &mut Option<Cells>, array: &ArrayRef) -> Result<(), String> {
    if let DataType::Dictionary(..) = array.data_type() {
        let dictionary = array.as_any_dictionary();
        let values = arrow_select::take::take(dictionary.values(), dictionary.keys(), None);
        return append(cells, &values.map_err(|error| error.to_string())?);
    }
    let other = || format!("cells of type {}", array.data_type());
    if let Some(Cells::Texts(texts)) = cells {
        texts.extend(self::texts(array).ok_or_else(other)?);
        return Ok(());
    }
    let more = whole(array)
        .map(Cells::Whole)
        .or_else(|| numbers(array).map(Cells::Numbers))
        .or_else(|| seconds(array).map(Cells::Seconds))
        .or_else(|| clocks(array).map(Cells::Clocks))
        .or_else(|| instants(array))
        .or_else(|| Some(Cells::Texts(self::texts(array)?)))
        .ok_or_else(other)?;
    match (&mut *cells, more) {
        (None, more) => *cells = Some(more),
        (Some(Cells::Numbers(all)), Cells::Numbers(more)) | (Some(Cells::Seconds(all)), Cells::Seconds(more)) => {
            all.extend(more);
        }
        (Some(Cells::Instants { nanoseconds: all, .. }), Cells::Instants { nanoseconds: more, .. })
        | (Some(Cells::Clocks(all)), Cells::Clocks(more))
        | (Some(Cells::Whole(all)), Cells::Whole(more)) => all.extend(more),
        _ => return Err(other()),
    }
    Ok(())
}

/// Each value as a number; NaN where there is none.
fn each<T: ArrowPrimitiveType>(array: &ArrayRef, number: impl Fn(T::Native) -> f64) -> Vec<f64> {
    array.as_primitive::<T>().iter().map(|value| value.map_or(f64::NAN, &number)).collect()
}

/// Whole numbers of 64 bits.
fn whole(array: &ArrayRef) -> Option<Vec<Option<i64>>> {
    match array.data_type() {
        DataType::Int64 => Some(array.as_primitive::<Int64Type>().iter().collect()),
        _ => None,
    }
}

fn numbers(array: &ArrayRef) -> Option<Vec<f64>> {
    // A decimal is a whole number of units.
    let unit = |scale: &i8| 10f64.powi((*scale).into());
    Some(match array.data_type() {
        DataType::Null => vec![f64::NAN; array.len()],
        DataType::Boolean => {
            array.as_boolean().iter().map(|value| value.map_or(f64::NAN, |value| f64::from(u8::from(value)))).collect()
        }
        DataType::Int8 => each::<Int8Type>(array, f64::from),
        DataType::Int16 => each::<Int16Type>(array, f64::from),
        DataType::Int32 => each::<Int32Type>(array, f64::from),
        DataType::UInt8 => each::<UInt8Type>(array, f64::from),
        DataType::UInt16 => each::<UInt16Type>(array, f64::from),
        DataType::UInt32 => each::<UInt32Type>(array, f64::from),
        DataType::UInt64 => each::<UInt64Type>(array, |value| value as f64),
        DataType::Float16 => each::<Float16Type>(array, f64::from),
        DataType::Float32 => each::<Float32Type>(array, f64::from),
        DataType::Float64 => each::<Float64Type>(array, |value| value),
        DataType::Decimal32(_, scale) => each::<Decimal32Type>(array, |value| f64::from(value) / unit(scale)),
        DataType::Decimal64(_, scale) => each::<Decimal64Type>(array, |value| value as f64 / unit(scale)),
        DataType::Decimal128(_, scale) => each::<Decimal128Type>(array, |value| value as f64 / unit(scale)),
        _ => return None,
    })
}

/// Lengths of time.
fn seconds(array: &ArrayRef) -> Option<Vec<f64>> {
    use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
    Some(match array.data_type() {
        DataType::Duration(Second) => each::<DurationSecondType>(array, |value| value as f64),
        DataType::Duration(Millisecond) => each::<DurationMillisecondType>(array, |value| value as f64 / 1e3),
        DataType::Duration(Microsecond) => each::<DurationMicrosecondType>(array, |value| value as f64 / 1e6),
        DataType::Duration(Nanosecond) => each::<DurationNanosecondType>(array, |value| value as f64 / 1e9),
        _ => return None,
    })
}

/// Counts of a unit of so many nanoseconds as nanoseconds; those that have no place in 64 bits are none.
fn nanoseconds<T: ArrowPrimitiveType>(array: &ArrayRef, unit: i64) -> Vec<Option<i64>>
where
    T::Native: Into<i64>,
{
    array.as_primitive::<T>().iter().map(|value| value?.into().checked_mul(unit)).collect()
}

/// Times of day.
fn clocks(array: &ArrayRef) -> Option<Vec<Option<i64>>> {
    use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
    Some(match array.data_type() {
        DataType::Time32(Second) => nanoseconds::<Time32SecondType>(array, 1_000_000_000),
        DataType::Time32(Millisecond) => nanoseconds::<Time32MillisecondType>(array, 1_000_000),
        DataType::Time64(Microsecond) => nanoseconds::<Time64MicrosecondType>(array, 1_000),
        DataType::Time64(Nanosecond) => nanoseconds::<Time64NanosecondType>(array, 1),
        _ => return None,
    })
}

/// Dates.
fn instants(array: &ArrayRef) -> Option<Cells> {
    let nanoseconds = match array.data_type() {
        DataType::Timestamp(TimeUnit::Second, _) => nanoseconds::<TimestampSecondType>(array, 1_000_000_000),
        DataType::Timestamp(TimeUnit::Millisecond, _) => nanoseconds::<TimestampMillisecondType>(array, 1_000_000),
        DataType::Timestamp(TimeUnit::Microsecond, _) => nanoseconds::<TimestampMicrosecondType>(array, 1_000),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => nanoseconds::<TimestampNanosecondType>(array, 1),
        DataType::Date32 => nanoseconds::<Date32Type>(array, 86_400_000_000_000),
        DataType::Date64 => nanoseconds::<Date64Type>(array, 1_000_000),
        _ => return None,
    };
    let universal = matches!(array.data_type(), DataType::Timestamp(_, Some(_)));
    Some(Cells::Instants { nanoseconds, universal })
}

/// Texts, and whole numbers as texts; a text that is not there is empty.
fn texts(array: &ArrayRef) -> Option<Vec<String>> {
    fn of<T: ArrowPrimitiveType>(array: &ArrayRef) -> Vec<String>
    where
        T::Native: ToString,
    {
        array.as_primitive::<T>().iter().map(|value| value.map_or(String::new(), |value| value.to_string())).collect()
    }
    let owned = |text: Option<&str>| text.unwrap_or_default().to_owned();
    Some(match array.data_type() {
        DataType::Utf8 => array.as_string::<i32>().iter().map(owned).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(owned).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(owned).collect(),
        DataType::Int8 => of::<Int8Type>(array),
        DataType::Int16 => of::<Int16Type>(array),
        DataType::Int32 => of::<Int32Type>(array),
        DataType::Int64 => of::<Int64Type>(array),
        DataType::UInt8 => of::<UInt8Type>(array),
        DataType::UInt16 => of::<UInt16Type>(array),
        DataType::UInt32 => of::<UInt32Type>(array),
        DataType::UInt64 => of::<UInt64Type>(array),
        _ => return None,
    })
}
