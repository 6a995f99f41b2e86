//! The types of the fields of Parquet's metadata (parquet-format 2.12, `parquet.thrift`).
//!
//! The library takes a field for what its number says, whatever type the file gives it, and is then somewhere else in the
//! bytes than who reads the types. So both must agree before it is asked. Fields stand here in the order of their numbers, from 1 on.

use super::thrift::ThriftKind::{self, Byte, Bytes, Double, Flag, List, Number, Struct, Unknown};

pub(super) const FILE: &[ThriftKind] = &[
    Number,
    List(&Struct(SCHEMA_ELEMENT)),
    Number,
    List(&Struct(ROW_GROUP)),
    List(&Struct(KEY_VALUE)),
    Bytes,
    List(&Struct(&[Struct(&[]), Struct(&[])])),
    Struct(ENCRYPTION),
    Bytes,
];

const SCHEMA_ELEMENT: &[ThriftKind] =
    &[Number, Number, Number, Bytes, Number, Number, Number, Number, Number, Struct(LOGICAL_TYPE)];

const EMPTY: ThriftKind = Struct(&[]);
const TIME: ThriftKind = Struct(&[Flag, Struct(&[EMPTY, EMPTY, EMPTY])]);

const LOGICAL_TYPE: &[ThriftKind] = &[
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    Struct(&[Number, Number]),
    EMPTY,
    TIME,
    TIME,
    Unknown,
    Struct(&[Byte, Flag]),
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    Struct(&[Byte]),
    Struct(&[Bytes]),
    Struct(&[Bytes, Number]),
    EMPTY,
];

const KEY_VALUE: &[ThriftKind] = &[Bytes, Bytes];

const AES: ThriftKind = Struct(&[Bytes, Bytes, Flag]);
const ENCRYPTION: &[ThriftKind] = &[AES, AES];

const ROW_GROUP: &[ThriftKind] = &[
    List(&Struct(COLUMN_CHUNK)),
    Number,
    Number,
    List(&Struct(&[Number, Flag, Flag])),
    Number,
    Number,
    Number,
];

const COLUMN_CHUNK: &[ThriftKind] = &[
    Bytes,
    Number,
    Struct(COLUMN),
    Number,
    Number,
    Number,
    Number,
    Struct(&[EMPTY, Struct(&[List(&Bytes), Bytes])]),
    Bytes,
];

const COLUMN: &[ThriftKind] = &[
    Number,
    List(&Number),
    List(&Bytes),
    Number,
    Number,
    Number,
    Number,
    List(&Struct(KEY_VALUE)),
    Number,
    Number,
    Number,
    Struct(STATISTICS),
    List(&Struct(&[Number, Number, Number])),
    Number,
    Number,
    Struct(&[Number, List(&Number), List(&Number)]),
    Struct(&[Struct(BOX), List(&Number)]),
];

const BOX: &[ThriftKind] = &[Double, Double, Double, Double, Double, Double, Double, Double];

const STATISTICS: &[ThriftKind] = &[Bytes, Bytes, Number, Number, Bytes, Bytes, Flag, Flag, Number];

pub(super) const PAGE: &[ThriftKind] = &[
    Number,
    Number,
    Number,
    Number,
    Struct(&[Number, Number, Number, Number, Struct(STATISTICS)]),
    EMPTY,
    Struct(&[Number, Number, Flag]),
    Struct(&[Number, Number, Number, Number, Number, Number, Flag, Struct(STATISTICS)]),
];
