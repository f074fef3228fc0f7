//! Declaration of payload types.

/// Declares payloads by name, type name in iceoryx2, and fields. The default value is all zero.
macro_rules! payload {
    ($($(#[$doc:meta])* $name:ident $type_name:tt { $($fields:tt)* })*) => {$(
        $(#[$doc])*
        #[repr(C)]
        #[derive(
            Debug, Clone, Copy, PartialEq, ZeroCopySend,
            zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::Immutable,
        )]
        #[type_name($type_name)]
        pub struct $name { $($fields)* }

        impl Default for $name {
            fn default() -> Self {
                zerocopy::FromZeros::new_zeroed()
            }
        }
    )*};
}

pub(super) use payload;
