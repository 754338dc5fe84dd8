//! [`Unit`]: the registers of a processor and its instructions for them.

use super::routines::{Binary, LookUp, Unary, routines};
use crate::wide::Width;
use iced_x86::{Code, Register};

/// Registers of one size, and what works on them.
pub(super) struct Unit {
    /// Bytes of a register.
    pub bytes: usize,
    pub registers: u8,
    pub first: Register,
    /// Whether comparisons write masks.
    pub masks: bool,
    pub load: Code,
    pub store: Code,
    pub copy: Code,
    pub add: Code,
    pub sub: Code,
    pub mul: Code,
    pub div: Code,
    pub sqrt: Code,
    pub fma: Code,
    pub fnma: Code,
    pub xor: Code,
    pub and: Code,
    pub and_not: Code,
    pub or: Code,
    pub compare: Code,
    pub blend: Code,
    pub unary: Unary,
    pub binary: Binary,
    pub look_up: LookUp,
}

impl Unit {
    /// None for what machine code is not written for.
    pub fn of(width: Width) -> Option<Self> {
        let routines = routines(width)?;
        Some(match width.lanes() {
            8 => Unit::zmm(routines),
            4 => Unit::ymm(routines),
            _ => Unit::xmm(routines),
        })
    }

    /// Eight numbers of AVX-512.
    fn zmm((unary, binary, look_up): (Unary, Binary, LookUp)) -> Self {
        Unit {
            bytes: 64,
            registers: 32,
            first: Register::ZMM0,
            masks: true,
            load: Code::EVEX_Vmovupd_zmm_k1z_zmmm512,
            store: Code::EVEX_Vmovupd_zmmm512_k1z_zmm,
            copy: Code::EVEX_Vmovapd_zmm_k1z_zmmm512,
            add: Code::EVEX_Vaddpd_zmm_k1z_zmm_zmmm512b64_er,
            sub: Code::EVEX_Vsubpd_zmm_k1z_zmm_zmmm512b64_er,
            mul: Code::EVEX_Vmulpd_zmm_k1z_zmm_zmmm512b64_er,
            div: Code::EVEX_Vdivpd_zmm_k1z_zmm_zmmm512b64_er,
            sqrt: Code::EVEX_Vsqrtpd_zmm_k1z_zmmm512b64_er,
            fma: Code::EVEX_Vfmadd231pd_zmm_k1z_zmm_zmmm512b64_er,
            fnma: Code::EVEX_Vfnmadd231pd_zmm_k1z_zmm_zmmm512b64_er,
            xor: Code::EVEX_Vxorpd_zmm_k1z_zmm_zmmm512b64,
            and: Code::EVEX_Vandpd_zmm_k1z_zmm_zmmm512b64,
            and_not: Code::EVEX_Vandnpd_zmm_k1z_zmm_zmmm512b64,
            or: Code::EVEX_Vorpd_zmm_k1z_zmm_zmmm512b64,
            compare: Code::EVEX_Vcmppd_kr_k1_zmm_zmmm512b64_imm8_sae,
            blend: Code::EVEX_Vblendmpd_zmm_k1z_zmm_zmmm512b64,
            unary,
            binary,
            look_up,
        }
    }

    /// Four numbers of AVX2.
    fn ymm((unary, binary, look_up): (Unary, Binary, LookUp)) -> Self {
        Unit {
            bytes: 32,
            registers: 16,
            first: Register::YMM0,
            masks: false,
            load: Code::VEX_Vmovupd_ymm_ymmm256,
            store: Code::VEX_Vmovupd_ymmm256_ymm,
            copy: Code::VEX_Vmovapd_ymm_ymmm256,
            add: Code::VEX_Vaddpd_ymm_ymm_ymmm256,
            sub: Code::VEX_Vsubpd_ymm_ymm_ymmm256,
            mul: Code::VEX_Vmulpd_ymm_ymm_ymmm256,
            div: Code::VEX_Vdivpd_ymm_ymm_ymmm256,
            sqrt: Code::VEX_Vsqrtpd_ymm_ymmm256,
            fma: Code::VEX_Vfmadd231pd_ymm_ymm_ymmm256,
            fnma: Code::VEX_Vfnmadd231pd_ymm_ymm_ymmm256,
            xor: Code::VEX_Vxorpd_ymm_ymm_ymmm256,
            and: Code::VEX_Vandpd_ymm_ymm_ymmm256,
            and_not: Code::VEX_Vandnpd_ymm_ymm_ymmm256,
            or: Code::VEX_Vorpd_ymm_ymm_ymmm256,
            compare: Code::VEX_Vcmppd_ymm_ymm_ymmm256_imm8,
            blend: Code::VEX_Vblendvpd_ymm_ymm_ymmm256_ymm,
            unary,
            binary,
            look_up,
        }
    }

    /// One number.
    fn xmm((unary, binary, look_up): (Unary, Binary, LookUp)) -> Self {
        Unit {
            bytes: 8,
            registers: 16,
            first: Register::XMM0,
            masks: false,
            load: Code::VEX_Vmovsd_xmm_m64,
            store: Code::VEX_Vmovsd_m64_xmm,
            copy: Code::VEX_Vmovapd_xmm_xmmm128,
            add: Code::VEX_Vaddsd_xmm_xmm_xmmm64,
            sub: Code::VEX_Vsubsd_xmm_xmm_xmmm64,
            mul: Code::VEX_Vmulsd_xmm_xmm_xmmm64,
            div: Code::VEX_Vdivsd_xmm_xmm_xmmm64,
            sqrt: Code::VEX_Vsqrtsd_xmm_xmm_xmmm64,
            fma: Code::VEX_Vfmadd231sd_xmm_xmm_xmmm64,
            fnma: Code::VEX_Vfnmadd231sd_xmm_xmm_xmmm64,
            xor: Code::VEX_Vxorpd_xmm_xmm_xmmm128,
            and: Code::VEX_Vandpd_xmm_xmm_xmmm128,
            and_not: Code::VEX_Vandnpd_xmm_xmm_xmmm128,
            or: Code::VEX_Vorpd_xmm_xmm_xmmm128,
            compare: Code::VEX_Vcmpsd_xmm_xmm_xmmm64_imm8,
            blend: Code::VEX_Vblendvpd_xmm_xmm_xmmm128_xmm,
            unary,
            binary,
            look_up,
        }
    }

    /// Register number `i`.
    pub fn register(&self, i: u8) -> Register {
        self.first + u32::from(i)
    }
}
