//! All disk: objects by digest, memo (request -> object), transcript (append-only), atomic files.
