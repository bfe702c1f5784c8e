//! Two table slots in NOR flash.
