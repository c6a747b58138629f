use ::parquet::data_type::{BoolType, ByteArrayType, FloatType, Int32Type, Int64Type};
use ::parquet::schema::parser::parse_message_type;

use super::*;

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
        table.readings("day").unwrap().to_vec(),
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
