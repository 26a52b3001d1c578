// The functions of OpenGL 3.3 that the renderer calls, as pointers of each thread: a context of OSMesa and
// one of EGL have functions of their own. In this namespace a call such as glClear() finds the pointer.
#pragma once

#include <GL/glcorearb.h>

// clang-format off
#define HANDSIM_GL_FUNCTIONS(X)                                                                                                   \
  X(ACTIVETEXTURE, ActiveTexture) X(ATTACHSHADER, AttachShader) X(BINDBUFFER, BindBuffer) X(BINDFRAMEBUFFER, BindFramebuffer)     \
  X(BINDRENDERBUFFER, BindRenderbuffer) X(BINDTEXTURE, BindTexture) X(BINDVERTEXARRAY, BindVertexArray)                           \
  X(BLENDEQUATIONSEPARATE, BlendEquationSeparate) X(BLENDFUNCSEPARATE, BlendFuncSeparate) X(BUFFERDATA, BufferData)               \
  X(CHECKFRAMEBUFFERSTATUS, CheckFramebufferStatus) X(CLEAR, Clear) X(CLEARCOLOR, ClearColor) X(COMPILESHADER, CompileShader)     \
  X(CREATEPROGRAM, CreateProgram) X(CREATESHADER, CreateShader) X(DELETESHADER, DeleteShader) X(DEPTHFUNC, DepthFunc)             \
  X(DEPTHMASK, DepthMask) X(DISABLE, Disable) X(DRAWARRAYS, DrawArrays) X(DRAWBUFFERS, DrawBuffers) X(DRAWELEMENTS, DrawElements) \
  X(ENABLE, Enable) X(ENABLEVERTEXATTRIBARRAY, EnableVertexAttribArray) X(FRAMEBUFFERRENDERBUFFER, FramebufferRenderbuffer)       \
  X(FRAMEBUFFERTEXTURE2D, FramebufferTexture2D) X(GENBUFFERS, GenBuffers) X(GENFRAMEBUFFERS, GenFramebuffers)                     \
  X(GENRENDERBUFFERS, GenRenderbuffers) X(GENTEXTURES, GenTextures) X(GENVERTEXARRAYS, GenVertexArrays) X(GETERROR, GetError)     \
  X(GETPROGRAMIV, GetProgramiv) X(GETSHADERINFOLOG, GetShaderInfoLog) X(GETSHADERIV, GetShaderiv) X(GETSTRING, GetString)         \
  X(GETUNIFORMLOCATION, GetUniformLocation) X(LINKPROGRAM, LinkProgram) X(READPIXELS, ReadPixels)                                 \
  X(RENDERBUFFERSTORAGEMULTISAMPLE, RenderbufferStorageMultisample) X(SHADERSOURCE, ShaderSource) X(TEXIMAGE2D, TexImage2D)       \
  X(TEXIMAGE2DMULTISAMPLE, TexImage2DMultisample) X(TEXPARAMETERI, TexParameteri) X(UNIFORM1F, Uniform1f) X(UNIFORM1I, Uniform1i) \
  X(UNIFORM2FV, Uniform2fv) X(UNIFORM3FV, Uniform3fv) X(UNIFORM4FV, Uniform4fv) X(UNIFORMMATRIX3FV, UniformMatrix3fv)             \
  X(UNIFORMMATRIX4FV, UniformMatrix4fv) X(USEPROGRAM, UseProgram) X(STENCILFUNC, StencilFunc) X(STENCILOP, StencilOp)             \
  X(VERTEXATTRIBPOINTER, VertexAttribPointer) X(VIEWPORT, Viewport)
// clang-format on

namespace handsim::output {

#define HANDSIM_DECLARE(TYPE, NAME) inline constinit thread_local PFNGL##TYPE##PROC gl##NAME = nullptr;
HANDSIM_GL_FUNCTIONS(HANDSIM_DECLARE)
#undef HANDSIM_DECLARE

}  // namespace handsim::output
