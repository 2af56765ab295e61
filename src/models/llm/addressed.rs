//! Texts and schemas with their digests, so that an epoch's context message is written and hashed once and not for
//! every question.

use std::{fmt, ops::Deref, sync::Arc};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};
use serde_json::Value;

use crate::kernel::{Digest, canon::CanonError};

/// A text and the BLAKE3 of its bytes. Clones share both.
#[derive(Clone, PartialEq, Eq)]
pub struct Text(Arc<(String, Digest)>);

impl Text {
    /// Digest of the text.
    pub fn digest(&self) -> Digest {
        self.0.1
    }
}

impl From<String> for Text {
    fn from(text: String) -> Text {
        let digest = Digest::of_bytes(text.as_bytes());
        Text(Arc::new((text, digest)))
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Text {
        text.to_string().into()
    }
}

impl Deref for Text {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0.0
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self)
    }
}

impl Serialize for Text {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self)
    }
}

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Text, D::Error> {
        String::deserialize(deserializer).map(Text::from)
    }
}

/// A JSON schema and its digest under `evodrive/schema/1`. Clones share both.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema(Arc<(Value, Digest)>);

impl Schema {
    /// Makes the schema. It fails if the schema holds a number that JSON cannot hold.
    pub fn new(schema: Value) -> Result<Schema, CanonError> {
        let digest = Digest::of("evodrive/schema/1", &schema)?;
        Ok(Schema(Arc::new((schema, digest))))
    }

    /// Digest of the schema's JSON.
    pub fn digest(&self) -> Digest {
        self.0.1
    }
}

impl Deref for Schema {
    type Target = Value;

    fn deref(&self) -> &Value {
        &self.0.0
    }
}

impl Serialize for Schema {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Schema {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Schema, D::Error> {
        Schema::new(Value::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}
