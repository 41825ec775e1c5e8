//! Linear algebra this crate exists for: a banded matrix with one dense border column.
//! Knows no physics.

pub mod banded;
pub mod bordered;

/// The vector instructions that this processor's solves use: the last name of the type that `pulp` chose, such
/// as `V3` (AVX2 and FMA), `V4` (AVX-512), `Neon` or `Scalar`. They set the time, and not the results.
pub fn vector_instructions() -> &'static str {
    struct Chosen;
    impl pulp::WithSimd for Chosen {
        type Output = &'static str;

        fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
            std::any::type_name::<S>()
        }
    }
    let name = pulp::Arch::new().dispatch(Chosen);
    name.rsplit("::").next().unwrap_or(name)
}
