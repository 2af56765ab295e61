//! Tests that open a store, close it and open it again. A program of their own: a process that starts commands, as the
//! tests of `all` do, hands the store's lock to each for the moment before it runs, so that the store looks held.

mod cassette;
mod damage;
mod key_contract;
