//! Things that fail by order, to test boards, clients and this crate against.
//!
//! Only with the feature `fault-tools`, and for hosts: it allocates.
