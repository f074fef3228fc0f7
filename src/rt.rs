//! Real-time scheduling: asking for it and reading back what was granted.
