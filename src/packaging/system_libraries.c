// What a wheel takes from the system when a picture is drawn, and not before: OpenGL (OSMesa or EGL), by dlopen. Where a
// library is absent its first function answers as on a machine without a driver, and handsim says which package has it.
// Captions use the font of the wheel, because a bare system has no fonts.
#define _GNU_SOURCE
#include <EGL/egl.h>
#include <GL/osmesa.h>
#include <cairo-ft.h>
#include <dlfcn.h>
#include <stdbool.h>

// RETURN NAME(DECLARED) calls NAME(GIVEN) of LIBRARY, or returns OTHERWISE.
#define BORROW(LIBRARY, RETURN, NAME, DECLARED, GIVEN, OTHERWISE)         \
  RETURN NAME DECLARED {                                                  \
    static RETURN(*found) DECLARED = NULL;                                \
    void* const library = dlopen(LIBRARY, RTLD_LAZY | RTLD_LOCAL);        \
    if (!found && library) *(void**)&found = dlsym(library, #NAME);       \
    return found ? found GIVEN : OTHERWISE;                               \
  }

#define EGL "libEGL.so.1"
BORROW(EGL, const char*, eglQueryString, (EGLDisplay d, EGLint n), (d, n), NULL)
BORROW(EGL, EGLDisplay, eglGetPlatformDisplay, (EGLenum p, void* n, const EGLAttrib* a), (p, n, a), EGL_NO_DISPLAY)
BORROW(EGL, EGLBoolean, eglInitialize, (EGLDisplay d, EGLint* a, EGLint* b), (d, a, b), EGL_FALSE)
BORROW(EGL, EGLBoolean, eglBindAPI, (EGLenum a), (a), EGL_FALSE)
BORROW(EGL, EGLContext, eglCreateContext, (EGLDisplay d, EGLConfig c, EGLContext s, const EGLint* a), (d, c, s, a),
       EGL_NO_CONTEXT)
BORROW(EGL, EGLContext, eglGetCurrentContext, (void), (), EGL_NO_CONTEXT)
BORROW(EGL, EGLBoolean, eglMakeCurrent, (EGLDisplay d, EGLSurface a, EGLSurface b, EGLContext c), (d, a, b, c), EGL_FALSE)
BORROW(EGL, EGLBoolean, eglDestroyContext, (EGLDisplay d, EGLContext c), (d, c), EGL_FALSE)
BORROW(EGL, __eglMustCastToProperFunctionPointerType, eglGetProcAddress, (const char* n), (n), NULL)

#define OSMESA "libOSMesa.so.8"
BORROW(OSMESA, OSMesaContext, OSMesaCreateContextAttribs, (const int* a, OSMesaContext s), (a, s), NULL)
BORROW(OSMESA, OSMesaContext, OSMesaGetCurrentContext, (void), (), NULL)
BORROW(OSMESA, GLboolean, OSMesaMakeCurrent, (OSMesaContext c, void* b, GLenum t, GLsizei w, GLsizei h), (c, b, t, w, h),
       GL_FALSE)
BORROW(OSMESA, OSMESAproc, OSMesaGetProcAddress, (const char* n), (n), NULL)
void OSMesaDestroyContext(OSMesaContext context) {
  void* const library = dlopen(OSMESA, RTLD_LAZY | RTLD_LOCAL);
  void (*found)(OSMesaContext) = NULL;
  if (library) *(void**)&found = dlsym(library, "OSMesaDestroyContext");
  if (found) found(context);
}

bool handsim_finds_gl(void) { return dlopen(OSMESA, RTLD_LAZY | RTLD_LOCAL) || dlopen(EGL, RTLD_LAZY | RTLD_LOCAL); }

void handsim_font_file(bool bold, char* path, size_t room);  // in image.cpp

// The linker replaces cairo_select_font_face by this (--wrap). The faces are never freed: fonts of cairo may use them.
void __wrap_cairo_select_font_face(cairo_t* pen, const char* family, cairo_font_slant_t slant, cairo_font_weight_t weight) {
  static _Thread_local cairo_font_face_t* faces[2];
  (void)family, (void)slant;
  const int bold = weight == CAIRO_FONT_WEIGHT_BOLD;
  if (!faces[bold]) {
    FT_Library library;
    FT_Face face;
    char path[4096];
    handsim_font_file(bold, path, sizeof path);
    if (FT_Init_FreeType(&library) || FT_New_Face(library, path, 0, &face)) return;
    faces[bold] = cairo_ft_font_face_create_for_ft_face(face, 0);
  }
  cairo_set_font_face(pen, faces[bold]);
}
