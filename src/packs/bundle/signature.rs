//! Signatures: an in-toto statement about the manifest and the root, in a DSSE envelope, by ed25519. Keys are files as
//! openssl writes them (PKCS#8 and SubjectPublicKeyInfo, PEM). Nothing here draws a random number: ed25519 needs none.

use base64::{Engine, engine::general_purpose::STANDARD};
use ed25519_dalek::pkcs8::{DecodePrivateKey, DecodePublicKey};
use ed25519_dalek::{Signature, Signer as _, SigningKey, VerifyingKey};
use serde::Deserialize;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::kernel::hex;

use super::{BundleError, Manifest, names::MANIFEST};

const PAYLOAD_TYPE: &str = "application/vnd.in-toto+json";
const STATEMENT: &str = "https://in-toto.io/Statement/v1";
const PREDICATE: &str = "urn:evodrive:run/1";

/// Private key that signs.
pub struct Signer(SigningKey);

impl Signer {
    /// The private key in a file's text; `file` names it in messages, which never repeat its text.
    pub fn read(file: &str, pem: &str) -> Result<Signer, BundleError> {
        let key = SigningKey::from_pkcs8_pem(pem.trim());
        key.map(Signer).map_err(|_| {
            unusable(
                file,
                "an ed25519 private key (PKCS#8, PEM); `openssl genpkey -algorithm ed25519 -out key.pem` makes one",
            )
        })
    }

    /// The signed statement about a bundle.
    pub fn envelope(&self, manifest: &Manifest, manifest_bytes: &[u8]) -> Vec<u8> {
        let payload = serde_json::to_vec(&statement(manifest, manifest_bytes)).unwrap_or_default();
        let signature = self.0.sign(&encoded(&payload));
        let envelope = json!({
            "payload": STANDARD.encode(&payload), "payloadType": PAYLOAD_TYPE,
            "signatures": [{"keyid": name_of(&self.0.verifying_key()), "sig": STANDARD.encode(signature.to_bytes())}],
        });
        let mut text = serde_json::to_vec_pretty(&envelope).unwrap_or_default();
        text.push(b'\n');
        text
    }
}

fn unusable(file: &str, expected: &str) -> BundleError {
    BundleError::Signature { file: file.into(), problem: format!("expected {expected}"), key: true }
}

/// Returns the statement to sign: the manifest, which has the digest of every file, and the root.
fn statement(manifest: &Manifest, manifest_bytes: &[u8]) -> Value {
    json!({
        "_type": STATEMENT,
        "subject": [{"name": MANIFEST, "digest": {"sha256": hex::encoded(&Sha256::digest(manifest_bytes))}}],
        "predicateType": PREDICATE,
        "predicate": {"root": manifest.root, "experiment": manifest.experiment, "pool": manifest.pool,
            "versions": manifest.versions},
    })
}

/// Joins type and payload as DSSE does before they are signed.
fn encoded(payload: &[u8]) -> Vec<u8> {
    let head = format!("DSSEv1 {} {PAYLOAD_TYPE} {} ", PAYLOAD_TYPE.len(), payload.len());
    [head.as_bytes(), payload].concat()
}

/// A key by the SHA-256 of its 32 bytes.
fn name_of(key: &VerifyingKey) -> String {
    hex::encoded(&Sha256::digest(key.as_bytes()))
}

/// The name that a public key's signatures bear.
///
/// # Errors
/// A text that is no public key.
pub fn key_name(file: &str, pem: &str) -> Result<String, BundleError> {
    public(file, pem).map(|key| name_of(&key))
}

fn public(file: &str, pem: &str) -> Result<VerifyingKey, BundleError> {
    VerifyingKey::from_public_key_pem(pem.trim()).map_err(|_| {
        unusable(file, "an ed25519 public key (PEM); `openssl pkey -in key.pem -pubout -out key.pub.pem` makes it")
    })
}

#[derive(Deserialize)]
struct Envelope {
    payload: String,
    #[serde(rename = "payloadType")]
    payload_type: String,
    signatures: Vec<Signed>,
}

#[derive(Deserialize)]
struct Signed {
    sig: String,
}

/// Checks that an envelope bears a signature of this key over this manifest.
///
/// # Errors
/// A file that is not a key; an envelope that cannot be read, is about another manifest, or is not signed by this key.
pub fn verified(
    bundle: &str,
    manifest: &Manifest,
    manifest_bytes: &[u8],
    envelope: &[u8],
    key_file: &str,
    pem: &str,
) -> Result<(), BundleError> {
    let key = public(key_file, pem)?;
    let wrong = |problem: &str| BundleError::Signature { file: bundle.into(), problem: problem.into(), key: false };
    let envelope: Envelope =
        serde_json::from_slice(envelope).map_err(|_| wrong("its signature is not a DSSE envelope"))?;
    let payload = STANDARD.decode(&envelope.payload).map_err(|_| wrong("its signed statement is not base64"))?;
    if envelope.payload_type != PAYLOAD_TYPE {
        return Err(wrong("its signed statement does not have in-toto's type"));
    }
    let message = encoded(&payload);
    let by_key = |signed: &Signed| {
        let bytes = STANDARD.decode(&signed.sig).ok()?;
        key.verify_strict(&message, &Signature::from_slice(&bytes).ok()?).ok()
    };
    if !envelope.signatures.iter().any(|signed| by_key(signed).is_some()) {
        return Err(wrong("expected a signature by the given key, found none"));
    }
    let stated: Option<Value> = serde_json::from_slice(&payload).ok();
    if stated != Some(statement(manifest, manifest_bytes)) {
        return Err(wrong("its signed statement is about another manifest"));
    }
    Ok(())
}
