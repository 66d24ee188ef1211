//! An OpenGL context without a display, from whatever EGL the machine has: looked for at run time, so that programs start
//! without one.
#![allow(unsafe_code, reason = "EGL is a C library")]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::marker::PhantomData;
use std::ptr::null_mut;

unsafe extern "C" {
    fn dlopen(file: *const c_char, flags: c_int) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
}

/// `dlopen`: resolve all symbols at once.
const RTLD_NOW: c_int = 2;
// Values of EGL 1.5 and its extensions.
const PLATFORM_SURFACELESS_MESA: u32 = 0x31DD;
const OPENGL_API: u32 = 0x30A2;
const NONE: i32 = 0x3038;
/// `SURFACE_TYPE` with `PBUFFER_BIT`, `RENDERABLE_TYPE` with `OPENGL_BIT`, 8 bits of each colour and 24 of depth.
const CONFIG: [i32; 13] = [0x3033, 1, 0x3040, 8, 0x3024, 8, 0x3023, 8, 0x3022, 8, 0x3025, 24, NONE];
/// Width and height of a surface that nobody draws on.
const SURFACE: [i32; 5] = [0x3057, 16, 0x3056, 16, NONE];

type Handle = *mut c_void;
type GetPlatformDisplay = unsafe extern "C" fn(u32, Handle, *const isize) -> Handle;
type Initialize = unsafe extern "C" fn(Handle, *mut i32, *mut i32) -> u32;
type BindApi = unsafe extern "C" fn(u32) -> u32;
type ChooseConfig = unsafe extern "C" fn(Handle, *const i32, *mut Handle, i32, *mut i32) -> u32;
type CreatePbuffer = unsafe extern "C" fn(Handle, Handle, *const i32) -> Handle;
type CreateContext = unsafe extern "C" fn(Handle, Handle, Handle, *const i32) -> Handle;
type MakeCurrent = unsafe extern "C" fn(Handle, Handle, Handle, Handle) -> u32;
type Destroy = unsafe extern "C" fn(Handle, Handle) -> u32;

/// A current OpenGL context of this thread; gone when dropped.
pub(crate) struct GlContext {
    display: Handle,
    surface: Handle,
    context: Handle,
    make_current: MakeCurrent,
    destroy_surface: Destroy,
    destroy_context: Destroy,
    /// Bound to its thread.
    _thread: PhantomData<*const ()>,
}

impl GlContext {
    /// # Errors
    /// What is missing on this machine.
    pub(crate) fn new() -> Result<Self, String> {
        // MuJoCo ends the process when it finds no OpenGL.
        open(&[c"libGL.so.1", c"libOpenGL.so.0"])?;
        let egl = open(&[c"libEGL.so.1"])?;
        // SAFETY: the types are those of the functions' declarations in egl.h; the library is never closed.
        unsafe {
            let get_display: GetPlatformDisplay = std::mem::transmute(find(egl, c"eglGetPlatformDisplay")?);
            let initialize: Initialize = std::mem::transmute(find(egl, c"eglInitialize")?);
            let bind_api: BindApi = std::mem::transmute(find(egl, c"eglBindAPI")?);
            let choose_config: ChooseConfig = std::mem::transmute(find(egl, c"eglChooseConfig")?);
            let create_surface: CreatePbuffer = std::mem::transmute(find(egl, c"eglCreatePbufferSurface")?);
            let create_context: CreateContext = std::mem::transmute(find(egl, c"eglCreateContext")?);
            let make_current: MakeCurrent = std::mem::transmute(find(egl, c"eglMakeCurrent")?);
            let destroy_surface: Destroy = std::mem::transmute(find(egl, c"eglDestroySurface")?);
            let destroy_context: Destroy = std::mem::transmute(find(egl, c"eglDestroyContext")?);
            let display = get_display(PLATFORM_SURFACELESS_MESA, null_mut(), [NONE as isize].as_ptr());
            if display.is_null() || initialize(display, null_mut(), null_mut()) == 0 {
                return Err("EGL has no display without a screen (Mesa's surfaceless platform)".into());
            }
            let (mut config, mut count) = (null_mut(), 0);
            bind_api(OPENGL_API);
            if choose_config(display, CONFIG.as_ptr(), &mut config, 1, &mut count) == 0 || count == 0 {
                return Err("EGL offers no OpenGL with a depth buffer".into());
            }
            let surface = create_surface(display, config, SURFACE.as_ptr());
            let context = create_context(display, config, null_mut(), [NONE].as_ptr());
            let made = Self {
                display,
                surface,
                context,
                make_current,
                destroy_surface,
                destroy_context,
                _thread: PhantomData,
            };
            if surface.is_null() || context.is_null() || make_current(display, surface, surface, context) == 0 {
                return Err("EGL makes no OpenGL context".into());
            }
            Ok(made)
        }
    }
}

impl Drop for GlContext {
    fn drop(&mut self) {
        // SAFETY: the handles are this context's own; EGL answers a null handle with an error code.
        unsafe {
            (self.make_current)(self.display, null_mut(), null_mut(), null_mut());
            (self.destroy_context)(self.display, self.context);
            (self.destroy_surface)(self.display, self.surface);
        }
    }
}

/// The first of the libraries that is there.
fn open(names: &[&CStr]) -> Result<Handle, String> {
    // SAFETY: the names end in a zero; the libraries are the system's OpenGL and EGL.
    let found = names.iter().map(|name| unsafe { dlopen(name.as_ptr(), RTLD_NOW) }).find(|handle| !handle.is_null());
    found.ok_or_else(|| format!("there is no {}", names[0].to_string_lossy()))
}

fn find(library: Handle, name: &CStr) -> Result<Handle, String> {
    // SAFETY: the library is open and the name ends in a zero.
    let symbol = unsafe { dlsym(library, name.as_ptr()) };
    if symbol.is_null() { Err(format!("EGL lacks {}", name.to_string_lossy())) } else { Ok(symbol) }
}
