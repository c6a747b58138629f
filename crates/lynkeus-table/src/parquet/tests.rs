use std::sync::Arc;
use std::time::Duration;

use ::parquet::basic::Compression;
use ::parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, FixedLenByteArray, FixedLenByteArrayType, FloatType,
    Int32Type, Int64Type,
};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::parser::parse_message_type;
use lynkeus_expr::{Budget, Memory};

use super::*;
use crate::Series;

/// A file with one group of three rows, each column's values and which of them are there.
fn written(schema: &str, fill: impl FnOnce(&mut Group<'_>)) -> tempfile::NamedTempFile {
    let file = tempfile::Builder::new()
        .suffix(".parquet")
        .tempfile()
        .unwrap();
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let compression = Compression::SNAPPY;
    let properties = WriterProperties::builder().set_compression(compression);
    let target = file.reopen().unwrap();
    let mut writer =
        SerializedFileWriter::new(target, schema, Arc::new(properties.build())).unwrap();
    let mut group = writer.next_row_group().unwrap();
    fill(&mut group);
    group.close().unwrap();
    writer.close().unwrap();
    file
}

type Group<'a> = ::parquet::file::writer::SerializedRowGroupWriter<'a, File>;

fn column<T: DataType>(group: &mut Group<'_>, values: &[T::T], levels: Option<&[i16]>) {
    let mut column = group.next_column().unwrap().unwrap();
    let typed = column.typed::<T>();
    typed.write_batch(values, levels, None).unwrap();
    column.close().unwrap();
}

#[test]
fn what_is_written_is_read_back_to_the_bit() {
    let file = tempfile::Builder::new()
        .suffix(".PARQUET")
        .tempfile()
        .unwrap();
    let time: Vec<f64> = (0..20_000).map(|i| 1.7e9 + f64::from(i) * 1e-3).collect();
    let mut values: Vec<f64> = time.iter().map(|t| t.sin() / 3.0).collect();
    values[7] = f64::NAN;
    let mut target = file.reopen().unwrap();
    write_parquet(
        &mut target,
        &[("t", &time.clone().into()), ("x y", &values.clone().into())],
    )
    .unwrap();
    let table = Table::load(file.path()).unwrap();
    assert_eq!(table.time("t").unwrap().to_vec(), time);
    let read = table.readings("x y").unwrap();
    assert!(
        read.iter()
            .zip(&values)
            .all(|(a, b)| a == *b || (a.is_nan() && b.is_nan()))
    );
    let fault = &table.faults("x y")[0];
    assert_eq!((table.missing("x y"), fault.line), (1, 8));
    // a null is no NaN that somebody wrote
    assert_eq!(fault.to_string(), "an empty cell");
}

#[test]
fn every_kind_of_number_and_time() {
    let schema = "message log {
        required int64 t (TIMESTAMP(MILLIS, true));
        required int32 day (DATE);
        optional int32 count;
        required int32 large (INTEGER(32, false));
        required int64 price (DECIMAL(10, 2));
        required float f;
        required boolean on;
        optional binary word (STRING);
        required group nested { repeated int32 list; }
    }";
    let file = written(schema, |group| {
        let hour = 1_795_305_600_000;
        column::<Int64Type>(group, &[hour, hour + 250, hour + 1000], None);
        column::<Int32Type>(group, &[0, 1, -1], None);
        column::<Int32Type>(group, &[7, -9], Some(&[1, 0, 1]));
        column::<Int32Type>(group, &[-1, 1, 2], None);
        column::<Int64Type>(group, &[12_345, -5, 100], None);
        column::<FloatType>(group, &[0.5, f32::NAN, 2.0], None);
        column::<BoolType>(group, &[true, false, true], None);
        let words = ["1.5", "off"].map(ByteArray::from);
        column::<ByteArrayType>(group, &words, Some(&[1, 1, 0]));
        let mut nested = group.next_column().unwrap().unwrap();
        let lists = nested.typed::<Int32Type>();
        lists
            .write_batch(&[], Some(&[0, 0, 0]), Some(&[0, 0, 0]))
            .unwrap();
        nested.close().unwrap();
    });
    let table = Table::load(file.path()).unwrap();
    assert_eq!(table.time("t").unwrap().to_vec(), [0.0, 0.25, 1.0]);
    assert_eq!(table.origin("t"), Some("2026-11-22T00:00:00Z"));
    assert_eq!(
        table.times("day").unwrap().to_vec(),
        [0.0, 86_400.0, -86_400.0]
    );
    let count = table.held("count").unwrap();
    assert_eq!(
        (count.to_vec(), table.missing("count")),
        (vec![7.0, 7.0, -9.0], 1)
    );
    assert_eq!(
        table.column("large").unwrap().to_vec(),
        [4_294_967_295.0, 1.0, 2.0]
    );
    assert_eq!(
        table.column("price").unwrap().to_vec(),
        [123.45, -0.05, 1.0]
    );
    assert_eq!(table.held("f").unwrap().to_vec(), [0.5, 0.5, 2.0]);
    assert_eq!(table.column("on").unwrap().to_vec(), [1.0, 0.0, 1.0]);
    assert_eq!(
        (
            table.missing("word"),
            table.readings("word").unwrap().first()
        ),
        (2, Some(1.5))
    );
    assert!(table.column("nested.list").is_err());
}

#[test]
fn damaged_files_are_refused_by_a_line() {
    let mut whole = Vec::new();
    let values: Vec<f64> = (0..1000).map(f64::from).collect();
    write_parquet(&mut whole, &[("t", &values.into())]).unwrap();
    for length in [0, 3, 8, whole.len() / 2, whole.len() - 1] {
        let file = tempfile::Builder::new()
            .suffix(".parquet")
            .tempfile()
            .unwrap();
        std::fs::write(file.path(), &whole[..length]).unwrap();
        let message = Table::load(file.path()).unwrap_err().to_string();
        assert!(message.contains("cut short"), "{length}: {message}");
        assert_eq!(message.lines().count(), 1);
    }
}

/// The bytes of a decimal may be digits of a text as well.
#[test]
fn decimals_and_halves_are_what_they_are_whatever_their_bytes() {
    let schema = "message log {
        required fixed_len_byte_array(1) level (DECIMAL(2, 1));
        required binary deep (DECIMAL(30, 3));
        required fixed_len_byte_array(2) half (FLOAT16);
        required int64 clock (TIME(MICROS, true));
        required fixed_len_byte_array(16) id (UUID);
        required fixed_len_byte_array(2) raw;
    }";
    let file = written(schema, |group| {
        let fixed = |bytes: &[u8]| FixedLenByteArray::from(ByteArray::from(bytes.to_vec()));
        let levels = [&[0x34][..], &[0x39], &[0xfe]].map(fixed);
        column::<FixedLenByteArrayType>(group, &levels, None);
        let deep = [
            vec![0x31],
            vec![0xff, 0x31],
            123_456_789_000_i128.to_be_bytes().to_vec(),
        ];
        column::<ByteArrayType>(group, &deep.map(ByteArray::from), None);
        let halves = [[0x33, 0x45], [0x00, 0xc0], [0x00, 0x7e]].map(|b| fixed(&b));
        column::<FixedLenByteArrayType>(group, &halves, None);
        column::<Int64Type>(group, &[0, 1, 2], None);
        column::<FixedLenByteArrayType>(group, &[0, 1, 2].map(|k| fixed(&[k; 16])), None);
        column::<FixedLenByteArrayType>(
            group,
            &["12", "34", "56"].map(|t| fixed(t.as_bytes())),
            None,
        );
    });
    let table = Table::load(file.path()).unwrap();
    let of = |name: &str| table.readings(name).unwrap().to_vec();
    assert_eq!(of("level"), [5.2, 5.7, -0.2]);
    assert_eq!(of("deep"), [0.049, -0.207, 123_456_789.0]);
    assert_eq!(
        (of("half")[..2].to_vec(), table.missing("half")),
        (vec![5.199_218_75, -2.0], 1)
    );
    for (name, what) in [
        ("clock", "times of a day"),
        ("id", "UUIDs"),
        ("raw", "bytes"),
    ] {
        let refusal = table.times(name).unwrap_err().to_string();
        assert!(refusal.contains(&format!("found {what}")), "{refusal}");
    }
    let refusal = refused_reading("required int32 level (DATE)");
    assert!(refusal.contains("only times may be dates"), "{refusal}");
}

/// Why a column of three days is no reading.
fn refused_reading(declared: &str) -> String {
    let file = written(&format!("message log {{ {declared}; }}"), |group| {
        column::<Int32Type>(group, &[0, 1, 2], None);
    });
    let table = Table::load(file.path()).unwrap();
    assert!(table.times("level").is_ok());
    table.readings("level").unwrap_err().to_string()
}

/// Whatever a byte says, a file is read or refused, and never ends the program.
#[test]
fn files_of_which_bytes_were_changed_are_read_or_refused() {
    let values: Vec<f64> = (0..300).map(|k| f64::from(k % 7)).collect();
    let mut whole = Vec::new();
    let columns: Vec<Series> = vec![values.clone().into(), values.into()];
    write_parquet(&mut whole, &[("t", &columns[0]), ("y", &columns[1])]).unwrap();
    let file = tempfile::Builder::new()
        .suffix(".parquet")
        .tempfile()
        .unwrap();
    let (mut refused, mut seed) = (0, 7_u64);
    let mut draw = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as usize % below
    };
    for _ in 0..600 {
        let mut bytes = whole.clone();
        for _ in 0..=draw(10) {
            let place = draw(bytes.len());
            bytes[place] = u8::try_from(draw(256)).unwrap();
        }
        std::fs::write(file.path(), &bytes).unwrap();
        if let Err(error) = Table::load(file.path()) {
            refused += 1;
            assert!(error.to_string().contains("Parquet file"), "{error}");
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn what_nobody_asks_for_is_left_and_limits_hold_while_the_rest_is_read() {
    let zeros = Series::from(vec![0.0; 3_000_000]);
    let file = tempfile::Builder::new()
        .suffix(".parquet")
        .tempfile()
        .unwrap();
    let columns = [("t", &zeros), ("junk", &zeros)];
    write_parquet(&mut file.reopen().unwrap(), &columns).unwrap();
    let load = |columns: &[&str], budget: Budget| {
        let columns = Some(columns.iter().map(ToString::to_string).collect());
        Table::load_within(
            file.path(),
            &Request {
                budget,
                columns,
                ..Request::default()
            },
        )
    };
    let table = load(&["t"], Budget::default()).unwrap();
    assert_eq!((table.names().count(), table.rows()), (2, 3_000_000));
    assert!(table.times("t").is_ok() && table.get("junk").is_none());
    let kind = |budget| load(&["t"], budget).map(drop).unwrap_err().kind();
    let ended = lynkeus_answer::ErrorKind::Ended;
    assert_eq!(kind(Budget::new(Some(Duration::ZERO), None)), ended);
    let memory = |limit| Memory {
        limit,
        used: || 0,
        before: 0,
    };
    assert_eq!(kind(Budget::new(None, Some(memory(10)))), ended);
    assert!(load(&["t"], Budget::new(None, Some(memory(64 << 20)))).is_ok());
}
