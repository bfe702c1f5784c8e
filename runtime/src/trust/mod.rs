//! Who signed a table, and whether it may run here.
