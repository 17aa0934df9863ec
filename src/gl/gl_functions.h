#pragma once

#include <GL/glcorearb.h>

#include <functional>

/// The functions of OpenGL 4.5 core that Tessera calls: X(type name's middle, function name without "gl").
/// Whoever needs another adds it here.
// clang-format off
#define TESSERA_GL_FUNCTIONS(X) \
    X(ACTIVETEXTURE, ActiveTexture) X(ATTACHSHADER, AttachShader) X(BEGINQUERY, BeginQuery) \
    X(BINDBUFFER, BindBuffer) X(BINDBUFFERBASE, BindBufferBase) X(BINDBUFFERRANGE, BindBufferRange) \
    X(BINDFRAMEBUFFER, BindFramebuffer) X(BINDIMAGETEXTURE, BindImageTexture) X(BINDSAMPLER, BindSampler) \
    X(BINDTEXTUREUNIT, BindTextureUnit) X(BINDVERTEXARRAY, BindVertexArray) \
    X(BLENDEQUATION, BlendEquation) X(BLENDEQUATIONI, BlendEquationi) X(BLENDFUNC, BlendFunc) \
    X(BLENDFUNCI, BlendFunci) X(BLENDFUNCSEPARATE, BlendFuncSeparate) \
    X(BLITNAMEDFRAMEBUFFER, BlitNamedFramebuffer) \
    X(CHECKNAMEDFRAMEBUFFERSTATUS, CheckNamedFramebufferStatus) X(CLEAR, Clear) \
    X(CLEARBUFFERFI, ClearBufferfi) X(CLEARBUFFERFV, ClearBufferfv) X(CLEARBUFFERIV, ClearBufferiv) \
    X(CLEARBUFFERUIV, ClearBufferuiv) X(CLEARCOLOR, ClearColor) X(CLEARDEPTH, ClearDepth) \
    X(CLEARDEPTHF, ClearDepthf) X(CLEARNAMEDBUFFERDATA, ClearNamedBufferData) \
    X(CLEARNAMEDBUFFERSUBDATA, ClearNamedBufferSubData) \
    X(CLEARNAMEDFRAMEBUFFERFI, ClearNamedFramebufferfi) \
    X(CLEARNAMEDFRAMEBUFFERFV, ClearNamedFramebufferfv) \
    X(CLEARNAMEDFRAMEBUFFERIV, ClearNamedFramebufferiv) \
    X(CLEARNAMEDFRAMEBUFFERUIV, ClearNamedFramebufferuiv) X(CLEARTEXIMAGE, ClearTexImage) \
    X(CLEARTEXSUBIMAGE, ClearTexSubImage) X(CLIENTWAITSYNC, ClientWaitSync) X(CLIPCONTROL, ClipControl) \
    X(COLORMASK, ColorMask) X(COLORMASKI, ColorMaski) X(COMPILESHADER, CompileShader) \
    X(COPYIMAGESUBDATA, CopyImageSubData) X(COPYNAMEDBUFFERSUBDATA, CopyNamedBufferSubData) \
    X(CREATEBUFFERS, CreateBuffers) X(CREATEFRAMEBUFFERS, CreateFramebuffers) \
    X(CREATEPROGRAM, CreateProgram) X(CREATEQUERIES, CreateQueries) X(CREATESAMPLERS, CreateSamplers) \
    X(CREATESHADER, CreateShader) X(CREATETEXTURES, CreateTextures) \
    X(CREATEVERTEXARRAYS, CreateVertexArrays) X(CULLFACE, CullFace) \
    X(DEBUGMESSAGECALLBACK, DebugMessageCallback) X(DEBUGMESSAGECONTROL, DebugMessageControl) \
    X(DEBUGMESSAGEINSERT, DebugMessageInsert) X(DELETEBUFFERS, DeleteBuffers) \
    X(DELETEFRAMEBUFFERS, DeleteFramebuffers) X(DELETEPROGRAM, DeleteProgram) \
    X(DELETEQUERIES, DeleteQueries) X(DELETESAMPLERS, DeleteSamplers) X(DELETESHADER, DeleteShader) \
    X(DELETESYNC, DeleteSync) X(DELETETEXTURES, DeleteTextures) X(DELETEVERTEXARRAYS, DeleteVertexArrays) \
    X(DEPTHFUNC, DepthFunc) X(DEPTHMASK, DepthMask) X(DEPTHRANGE, DepthRange) X(DEPTHRANGEF, DepthRangef) \
    X(DETACHSHADER, DetachShader) X(DISABLE, Disable) \
    X(DISABLEVERTEXARRAYATTRIB, DisableVertexArrayAttrib) X(DISABLEI, Disablei) \
    X(DISPATCHCOMPUTE, DispatchCompute) X(DISPATCHCOMPUTEINDIRECT, DispatchComputeIndirect) \
    X(DRAWARRAYS, DrawArrays) X(DRAWARRAYSINDIRECT, DrawArraysIndirect) \
    X(DRAWARRAYSINSTANCED, DrawArraysInstanced) \
    X(DRAWARRAYSINSTANCEDBASEINSTANCE, DrawArraysInstancedBaseInstance) X(DRAWELEMENTS, DrawElements) \
    X(DRAWELEMENTSBASEVERTEX, DrawElementsBaseVertex) X(DRAWELEMENTSINDIRECT, DrawElementsIndirect) \
    X(DRAWELEMENTSINSTANCED, DrawElementsInstanced) \
    X(DRAWELEMENTSINSTANCEDBASEINSTANCE, DrawElementsInstancedBaseInstance) \
    X(DRAWELEMENTSINSTANCEDBASEVERTEX, DrawElementsInstancedBaseVertex) \
    X(DRAWELEMENTSINSTANCEDBASEVERTEXBASEINSTANCE, DrawElementsInstancedBaseVertexBaseInstance) \
    X(ENABLE, Enable) X(ENABLEVERTEXARRAYATTRIB, EnableVertexArrayAttrib) X(ENABLEI, Enablei) \
    X(ENDQUERY, EndQuery) X(FENCESYNC, FenceSync) X(FINISH, Finish) X(FLUSH, Flush) \
    X(FLUSHMAPPEDNAMEDBUFFERRANGE, FlushMappedNamedBufferRange) X(FRONTFACE, FrontFace) \
    X(GENERATETEXTUREMIPMAP, GenerateTextureMipmap) X(GENQUERIES, GenQueries) X(GETACTIVEUNIFORM, GetActiveUniform) \
    X(GETBOOLEANV, GetBooleanv) X(GETDOUBLEV, GetDoublev) X(GETERROR, GetError) X(GETFLOATV, GetFloatv) \
    X(GETGRAPHICSRESETSTATUS, GetGraphicsResetStatus) \
    X(GETINTEGER64V, GetInteger64v) X(GETINTEGERI_V, GetIntegeri_v) X(GETINTEGERV, GetIntegerv) \
    X(GETINTERNALFORMATIV, GetInternalformativ) \
    X(GETNAMEDBUFFERPARAMETERI64V, GetNamedBufferParameteri64v) \
    X(GETNAMEDBUFFERSUBDATA, GetNamedBufferSubData) X(GETPROGRAMINFOLOG, GetProgramInfoLog) \
    X(GETPROGRAMRESOURCEINDEX, GetProgramResourceIndex) X(GETPROGRAMIV, GetProgramiv) \
    X(GETQUERYOBJECTI64V, GetQueryObjecti64v) X(GETQUERYOBJECTIV, GetQueryObjectiv) \
    X(GETQUERYOBJECTUI64V, GetQueryObjectui64v) X(GETQUERYOBJECTUIV, GetQueryObjectuiv) \
    X(GETSHADERINFOLOG, GetShaderInfoLog) X(GETSHADERIV, GetShaderiv) X(GETSTRING, GetString) \
    X(GETSTRINGI, GetStringi) X(GETTEXTUREIMAGE, GetTextureImage) \
    X(GETTEXTURELEVELPARAMETERIV, GetTextureLevelParameteriv) X(GETTEXTURESUBIMAGE, GetTextureSubImage) \
    X(GETUNIFORMBLOCKINDEX, GetUniformBlockIndex) X(GETUNIFORMLOCATION, GetUniformLocation) \
    X(INVALIDATEBUFFERDATA, InvalidateBufferData) X(INVALIDATEBUFFERSUBDATA, InvalidateBufferSubData) \
    X(INVALIDATEFRAMEBUFFER, InvalidateFramebuffer) \
    X(INVALIDATENAMEDFRAMEBUFFERDATA, InvalidateNamedFramebufferData) \
    X(INVALIDATETEXIMAGE, InvalidateTexImage) X(ISENABLED, IsEnabled) X(LINEWIDTH, LineWidth) \
    X(LINKPROGRAM, LinkProgram) X(LOGICOP, LogicOp) X(MAPNAMEDBUFFER, MapNamedBuffer) \
    X(MAPNAMEDBUFFERRANGE, MapNamedBufferRange) X(MEMORYBARRIER, MemoryBarrier) \
    X(MEMORYBARRIERBYREGION, MemoryBarrierByRegion) X(MULTIDRAWARRAYS, MultiDrawArrays) \
    X(MULTIDRAWARRAYSINDIRECT, MultiDrawArraysIndirect) X(MULTIDRAWELEMENTS, MultiDrawElements) \
    X(MULTIDRAWELEMENTSBASEVERTEX, MultiDrawElementsBaseVertex) \
    X(MULTIDRAWELEMENTSINDIRECT, MultiDrawElementsIndirect) X(NAMEDBUFFERDATA, NamedBufferData) \
    X(NAMEDBUFFERSTORAGE, NamedBufferStorage) X(NAMEDBUFFERSUBDATA, NamedBufferSubData) \
    X(NAMEDFRAMEBUFFERDRAWBUFFER, NamedFramebufferDrawBuffer) \
    X(NAMEDFRAMEBUFFERDRAWBUFFERS, NamedFramebufferDrawBuffers) \
    X(NAMEDFRAMEBUFFERPARAMETERI, NamedFramebufferParameteri) \
    X(NAMEDFRAMEBUFFERREADBUFFER, NamedFramebufferReadBuffer) \
    X(NAMEDFRAMEBUFFERTEXTURE, NamedFramebufferTexture) \
    X(NAMEDFRAMEBUFFERTEXTURELAYER, NamedFramebufferTextureLayer) X(OBJECTLABEL, ObjectLabel) \
    X(PIXELSTOREI, PixelStorei) X(POINTSIZE, PointSize) X(POLYGONMODE, PolygonMode) \
    X(POLYGONOFFSET, PolygonOffset) X(POPDEBUGGROUP, PopDebugGroup) \
    X(PRIMITIVERESTARTINDEX, PrimitiveRestartIndex) X(PROGRAMUNIFORM1D, ProgramUniform1d) \
    X(PROGRAMUNIFORM1F, ProgramUniform1f) X(PROGRAMUNIFORM1FV, ProgramUniform1fv) \
    X(PROGRAMUNIFORM1I, ProgramUniform1i) X(PROGRAMUNIFORM1IV, ProgramUniform1iv) \
    X(PROGRAMUNIFORM1UI, ProgramUniform1ui) X(PROGRAMUNIFORM1UIV, ProgramUniform1uiv) \
    X(PROGRAMUNIFORM2D, ProgramUniform2d) X(PROGRAMUNIFORM2F, ProgramUniform2f) \
    X(PROGRAMUNIFORM2FV, ProgramUniform2fv) X(PROGRAMUNIFORM2I, ProgramUniform2i) \
    X(PROGRAMUNIFORM2IV, ProgramUniform2iv) X(PROGRAMUNIFORM2UI, ProgramUniform2ui) \
    X(PROGRAMUNIFORM3D, ProgramUniform3d) X(PROGRAMUNIFORM3F, ProgramUniform3f) \
    X(PROGRAMUNIFORM3FV, ProgramUniform3fv) X(PROGRAMUNIFORM3I, ProgramUniform3i) \
    X(PROGRAMUNIFORM3IV, ProgramUniform3iv) X(PROGRAMUNIFORM3UI, ProgramUniform3ui) \
    X(PROGRAMUNIFORM3UIV, ProgramUniform3uiv) \
    X(PROGRAMUNIFORM4D, ProgramUniform4d) X(PROGRAMUNIFORM4F, ProgramUniform4f) \
    X(PROGRAMUNIFORM4FV, ProgramUniform4fv) X(PROGRAMUNIFORM4I, ProgramUniform4i) \
    X(PROGRAMUNIFORM4IV, ProgramUniform4iv) X(PROGRAMUNIFORM4UI, ProgramUniform4ui) \
    X(PROGRAMUNIFORMMATRIX3FV, ProgramUniformMatrix3fv) \
    X(PROGRAMUNIFORMMATRIX4DV, ProgramUniformMatrix4dv) \
    X(PROGRAMUNIFORMMATRIX4FV, ProgramUniformMatrix4fv) X(PROVOKINGVERTEX, ProvokingVertex) X(PUSHDEBUGGROUP, PushDebugGroup) \
    X(QUERYCOUNTER, QueryCounter) X(READBUFFER, ReadBuffer) X(READPIXELS, ReadPixels) \
    X(SAMPLEMASKI, SampleMaski) X(SAMPLERPARAMETERF, SamplerParameterf) \
    X(SAMPLERPARAMETERFV, SamplerParameterfv) X(SAMPLERPARAMETERI, SamplerParameteri) X(SCISSOR, Scissor) \
    X(SCISSORINDEXED, ScissorIndexed) X(SHADERSOURCE, ShaderSource) \
    X(SHADERSTORAGEBLOCKBINDING, ShaderStorageBlockBinding) X(STENCILFUNC, StencilFunc) \
    X(STENCILMASK, StencilMask) X(STENCILOP, StencilOp) X(TEXTUREBUFFER, TextureBuffer) \
    X(TEXTUREBUFFERRANGE, TextureBufferRange) X(TEXTUREPARAMETERF, TextureParameterf) \
    X(TEXTUREPARAMETERFV, TextureParameterfv) X(TEXTUREPARAMETERI, TextureParameteri) \
    X(TEXTURESTORAGE1D, TextureStorage1D) X(TEXTURESTORAGE2D, TextureStorage2D) \
    X(TEXTURESTORAGE3D, TextureStorage3D) X(TEXTURESUBIMAGE1D, TextureSubImage1D) \
    X(TEXTURESUBIMAGE2D, TextureSubImage2D) X(TEXTURESUBIMAGE3D, TextureSubImage3D) \
    X(TEXTUREVIEW, TextureView) X(UNIFORMBLOCKBINDING, UniformBlockBinding) \
    X(UNMAPNAMEDBUFFER, UnmapNamedBuffer) X(USEPROGRAM, UseProgram) X(VALIDATEPROGRAM, ValidateProgram) \
    X(VERTEXARRAYATTRIBBINDING, VertexArrayAttribBinding) \
    X(VERTEXARRAYATTRIBFORMAT, VertexArrayAttribFormat) \
    X(VERTEXARRAYATTRIBIFORMAT, VertexArrayAttribIFormat) \
    X(VERTEXARRAYATTRIBLFORMAT, VertexArrayAttribLFormat) \
    X(VERTEXARRAYBINDINGDIVISOR, VertexArrayBindingDivisor) \
    X(VERTEXARRAYELEMENTBUFFER, VertexArrayElementBuffer) \
    X(VERTEXARRAYVERTEXBUFFER, VertexArrayVertexBuffer) \
    X(VERTEXARRAYVERTEXBUFFERS, VertexArrayVertexBuffers) X(VIEWPORT, Viewport) \
    X(VIEWPORTINDEXEDF, ViewportIndexedf) X(WAITSYNC, WaitSync)
// clang-format on

namespace tessera {

/// A pointer to every function in the list, of the context it was loaded for: `gl.DrawArrays(...)`. The names
/// are OpenGL's own without the prefix, so that its manual can be searched for them.
struct GlFunctions {
#define TESSERA_GL_MEMBER(TYPE, NAME) PFNGL##TYPE##PROC NAME = nullptr;
    TESSERA_GL_FUNCTIONS(TESSERA_GL_MEMBER)
#undef TESSERA_GL_MEMBER
};

using GlProcAddress = void (*)();

/// Loads every function through the current context's own `getProcAddress`.
/// @throws GlError naming the first function that is missing.
GlFunctions loadGlFunctions(const std::function<GlProcAddress(const char*)>& getProcAddress);

}  // namespace tessera
