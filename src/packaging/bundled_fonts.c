// The captions of a wheel use the font of the wheel, because a bare system has no fonts.
#include <cairo-ft.h>
#include <stdbool.h>

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
