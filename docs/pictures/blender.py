# Makes the four scenes of docs/FORMATS.md as .glb files, and renders them with Cycles: `pip install bpy`, then `python blender.py FOLDER`.
import bpy, math, sys, os
import numpy as np
out = sys.argv[-1]
def clear():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    s = bpy.context.scene
    s.render.engine = 'CYCLES'
    c = s.cycles
    c.device='CPU'; c.samples=256; c.use_denoising=False; c.use_adaptive_sampling=False
    c.max_bounces=8; c.diffuse_bounces=0; c.glossy_bounces=8; c.transmission_bounces=8; c.transparent_max_bounces=16
    c.sample_clamp_indirect=0; c.caustics_reflective=True; c.caustics_refractive=True
    c.blur_glossy=0
    s.render.resolution_x=480; s.render.resolution_y=360; s.render.resolution_percentage=100
    s.view_settings.view_transform='Standard'; s.view_settings.look='None'
    s.render.filter_size=1.0; c.pixel_filter_type='BOX'
    w = bpy.data.worlds.new('w'); s.world = w
    w.use_nodes = True
    w.node_tree.nodes['Background'].inputs[0].default_value=(0,0,0,1)
    return s
def image(name, n, f, data=False, alpha=False):
    y,x = np.mgrid[0:n,0:n]
    px = f((x+.5)/n,(y+.5)/n).astype(np.float32)
    im = bpy.data.images.new(name, n, n, alpha=alpha, is_data=data)
    im.pixels.foreach_set(px.ravel()); im.pack(); 
    return im
def rgba(r,g,b,a=None):
    a = np.ones_like(r) if a is None else a
    return np.stack([r,g,b,a],-1)
def mat(name, base=(.8,.8,.8), metal=0, rough=.5, **k):
    m = bpy.data.materials.new(name); m.use_nodes=True
    p = m.node_tree.nodes['Principled BSDF']
    p.inputs['Base Color'].default_value=(*base,1); p.inputs['Metallic'].default_value=metal; p.inputs['Roughness'].default_value=rough
    p.inputs['IOR'].default_value=k.get('ior',1.5)
    p.inputs['Transmission Weight'].default_value=k.get('trans',0)
    if 'emit' in k:
        p.inputs['Emission Color'].default_value=(*k['emit'],1); p.inputs['Emission Strength'].default_value=k.get('strength',1)
    m.use_backface_culling=False
    return m,p
def tex(m, im, to, interp='Linear', scale=None, out='Color'):
    nt=m.node_tree; t=nt.nodes.new('ShaderNodeTexImage'); t.image=im; t.interpolation=interp
    if scale:
        mp=nt.nodes.new('ShaderNodeMapping'); uv=nt.nodes.new('ShaderNodeUVMap')
        mp.inputs['Scale'].default_value=(scale[0],scale[1],1); mp.inputs['Rotation'].default_value=(0,0,scale[2])
        nt.links.new(uv.outputs[0],mp.inputs[0]); nt.links.new(mp.outputs[0],t.inputs[0])
    nt.links.new(t.outputs[out], to); return t
def put(o, m): o.data.materials.clear(); o.data.materials.append(m)
def plane(size, m, loc=(0,0,0), rot=(0,0,0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=loc, rotation=rot); o=bpy.context.object; put(o,m); return o
def smooth(o): 
    for p in o.data.polygons: p.use_smooth=True
def light(kind, loc, energy, rot=(0,0,0), color=(1,1,1)):
    l=bpy.data.lights.new(kind,kind); l.energy=energy; l.color=color
    if kind in('POINT','SPOT'): l.shadow_soft_size=0
    if kind=='SUN': l.angle=0
    if kind=='SPOT': l.spot_size=math.radians(50); l.spot_blend=.3
    o=bpy.data.objects.new(kind,l); o.location=loc; o.rotation_euler=rot; bpy.context.collection.objects.link(o); return o
def camera(s, loc, look, lens=40):
    c=bpy.data.cameras.new('cam'); c.lens=lens; o=bpy.data.objects.new('cam',c); o.location=loc
    from mathutils import Vector
    o.rotation_euler=(Vector(look)-Vector(loc)).to_track_quat('-Z','Y').to_euler()
    bpy.context.collection.objects.link(o); s.camera=o
def done(s, name):
    if os.environ.get('ONLY_EXPORT'):
        bpy.ops.export_scene.gltf(filepath=os.path.join(out,name+'.glb'), export_format='GLB', export_cameras=True, export_lights=True, export_import_convert_lighting_mode='COMPAT', export_yup=True, export_apply=True); return
    bpy.ops.export_scene.gltf(filepath=os.path.join(out,name+'.glb'), export_format='GLB', export_cameras=True, export_lights=True, export_import_convert_lighting_mode='COMPAT', export_yup=True, export_apply=True)
    s.render.filepath=os.path.join(out,name+'-blender.png'); s.render.image_settings.file_format='PNG'
    bpy.ops.render.render(write_still=True)
    s.render.filepath=os.path.join(out,name+'-blender.exr'); s.render.image_settings.file_format='OPEN_EXR'
    bpy.data.images['Render Result'].save_render(s.render.filepath)

# 1: metals: suzanne in rough metal, on a textured floor
s=clear()
check=image('check',256,lambda u,v: rgba(*(3*[np.where((np.floor(u*8)+np.floor(v*8))%2==0,.75,.15)])))
m,p=mat('floor',rough=.35); tex(m,check,p.inputs['Base Color']); plane(8,m)
m,p=mat('gold',(1,.77,.34),1,.3); bpy.ops.mesh.primitive_monkey_add(size=2,location=(-.9,0,1),rotation=(-.6,0,0)); o=bpy.context.object; o.modifiers.new('s','SUBSURF').levels=2; o.modifiers['s'].render_levels=2; smooth(o); put(o,m)
m,p=mat('chrome',(.9,.9,.95),1,.0); bpy.ops.mesh.primitive_uv_sphere_add(segments=96,ring_count=48,radius=.8,location=(1.2,.3,.8)); o=bpy.context.object; smooth(o); put(o,m)
m,p=mat('plastic',(.8,.05,.05),0,.15); bpy.ops.mesh.primitive_uv_sphere_add(segments=96,ring_count=48,radius=.4,location=(.6,-1.2,.4)); o=bpy.context.object; smooth(o); put(o,m)
light('POINT',(-3,-3,5),900); light('SPOT',(4,-2,5),1200,rot=(math.radians(40),0,math.radians(55)),color=(.8,.9,1))
camera(s,(0,-6.5,3.2),(0,0,.7)); done(s,'metals')

# 2: pictures: normal, roughness, cut-out, turned and repeated
s=clear()
brick=image('brick',512,lambda u,v: (lambda j: rgba(np.where(j,.7,.45+.2*np.sin(37*np.floor(v*8)+11*np.floor(u*4+.5*(np.floor(v*8)%2)))),np.where(j,.68,.2),np.where(j,.62,.15)))((np.abs((v*8)%1-.5)>.44)|(np.abs((u*4+.5*(np.floor(v*8)%2))%1-.5)>.47)))
def nrm(u,v):
    jv=(v*8)%1-.5; ju=(u*4+.5*(np.floor(v*8)%2))%1-.5
    y=np.where(np.abs(jv)>.42,np.sign(jv)*.6,0.); x=np.where(np.abs(ju)>.46,np.sign(ju)*.6,0.)
    z=np.sqrt(np.maximum(1-x*x-y*y,.05)); l=np.sqrt(x*x+y*y+z*z)
    return rgba(x/l*.5+.5,y/l*.5+.5,z/l*.5+.5)
normal=image('normal',512,nrm,data=True)
rough=image('rough',64,lambda u,v: rgba(np.zeros_like(u),.15+.7*u,np.where(v>.5,1.,0.)),data=True)
leaf=image('leaf',128,lambda u,v: rgba(.1+.3*v,.5+.2*u,.1+0*u,np.where(((u-.5)**2*4+(v-.5)**2)<.2,1.,0.)),alpha=True)
m,p=mat('wall',rough=.8); tex(m,brick,p.inputs['Base Color'])
t=tex(m,normal,p.inputs['Normal']); nm=m.node_tree.nodes.new('ShaderNodeNormalMap'); m.node_tree.links.new(t.outputs[0],nm.inputs['Color']); m.node_tree.links.new(nm.outputs[0],p.inputs['Normal'])
plane(4,m,(-.4,1.5,2),(math.pi/2,0,0))
m,p=mat('floor',rough=.6); tex(m,image('tiles',128,lambda u,v: rgba(*(3*[.2+.6*((np.floor(u*4)+np.floor(v*4))%2)]))),p.inputs['Base Color'],scale=(3,2,.5)); plane(7,m)
m,p=mat('ramp',(.9,.5,.2)); t=tex(m,rough,p.inputs['Roughness']); sp=m.node_tree.nodes.new('ShaderNodeSeparateColor'); m.node_tree.links.new(t.outputs[0],sp.inputs[0]); m.node_tree.links.new(sp.outputs['Green'],p.inputs['Roughness']); m.node_tree.links.new(sp.outputs['Blue'],p.inputs['Metallic'])
bpy.ops.mesh.primitive_uv_sphere_add(segments=96,ring_count=48,radius=.7,location=(-1.2,-.6,.7)); o=bpy.context.object; smooth(o); put(o,m)
m,p=mat('leaf',rough=.6); t=tex(m,leaf,p.inputs['Base Color'],scale=(3,3,0)); 
mm=m.node_tree.nodes.new('ShaderNodeMath'); mm.operation='ROUND'; m.node_tree.links.new(t.outputs['Alpha'],mm.inputs[0]); m.node_tree.links.new(mm.outputs[0],p.inputs['Alpha'])
plane(1.8,m,(1.1,-.5,.95),(math.pi/2,0,-.4))
light('SUN',(0,0,5),2.5,rot=(.7,.35,.2)); light('POINT',(2.5,-3,2.5),120,color=(1,.9,.8))
camera(s,(.2,-6,2.3),(0,0,1)); done(s,'pictures')

# 3: glass, light and colours
s=clear()
m,p=mat('floor',(.6,.6,.6),rough=.9); plane(9,m); m,p=mat('back',(.35,.45,.6),rough=.9); plane(9,m,(0,3,2),(math.pi/2,0,0))
m,p=mat('glass',(1,1,1),rough=0,trans=1,ior=1.45); bpy.ops.mesh.primitive_uv_sphere_add(segments=128,ring_count=64,radius=.8,location=(-1.1,-.3,.8)); o=bpy.context.object; smooth(o); put(o,m)
m,p=mat('frosted',(.8,1,.85),rough=.25,trans=1,ior=1.45); bpy.ops.mesh.primitive_cube_add(size=1.1,location=(1.1,-.6,.56),rotation=(0,0,.5)); put(bpy.context.object,m)
m,p=mat('lamp',(.1,.1,.1),emit=(1,.7,.3),strength=3); bpy.ops.mesh.primitive_torus_add(location=(.1,1.2,1.6),rotation=(1.2,.3,0),major_radius=.6,minor_radius=.15,major_segments=64,minor_segments=24); o=bpy.context.object; smooth(o); put(o,m)
m,p=mat('painted',rough=.7); bpy.ops.mesh.primitive_uv_sphere_add(segments=64,ring_count=32,radius=.5,location=(0,-1.4,.5)); o=bpy.context.object; smooth(o); put(o,m)
at=o.data.color_attributes.new('Col','BYTE_COLOR','POINT')
for i,v in enumerate(o.data.vertices):
    c=v.co*.9+type(v.co)((.5,.5,.5)); at.data[i].color=(max(c.x,0),max(c.y,0),max(c.z,0),1)
ca=m.node_tree.nodes.new('ShaderNodeVertexColor'); ca.layer_name='Col'; m.node_tree.links.new(ca.outputs[0],p.inputs['Base Color'])
light('POINT',(2.5,-3.5,4.5),700); light('POINT',(-3,-2,3),250,color=(.7,.8,1))
camera(s,(0,-6.5,2.6),(0,0,.8)); done(s,'glass')

# 4: surroundings: a sky with a sun, above a chequered ground (`hybray render sky.glb --environment sky.hdr`)
s=clear()
def around(u,v):
    t=np.pi*(1-v); p=2*np.pi*(u-.5)
    d=np.stack([np.cos(p)*np.sin(t),-np.sin(p)*np.sin(t),np.cos(t)],-1)  # Blender's axes: the middle is +X, the right -Y
    sun=np.array([.35,-.6,.55]); sun/=np.linalg.norm(sun); c=d@sun
    z=d[...,2:3]; ground=np.minimum(z,-1e-2)
    checks=np.sign(np.sin(9*d[...,0:1]/ground)*np.sin(9*d[...,1:2]/ground))*(z<-.1)
    px=np.where(z>0,np.array([.25,.45,.9])*(.6+.5*(1-np.clip(z,0,1)))+np.exp(-(1-c)/.02)[...,None]*np.array([1.5,1.3,.9]),np.array([.18,.15,.11])*(1+.5*checks))
    px=px+np.where(c>np.cos(np.radians(1)),1,0)[...,None]*np.array([2000.,1900.,1700.])
    return np.concatenate([px,np.ones_like(px[...,:1])],-1)
y,x=np.mgrid[0:512,0:1024]
im=bpy.data.images.new('sky',1024,512,alpha=False,float_buffer=True,is_data=True); im.pixels.foreach_set(around((x+.5)/1024,(y+.5)/512).astype(np.float32).ravel())
im.filepath_raw=os.path.join(out,'sky.hdr'); im.file_format='HDR'; im.save(); im=bpy.data.images.load(os.path.join(out,'sky.hdr'))
nt=s.world.node_tree; e=nt.nodes.new('ShaderNodeTexEnvironment'); e.image=im; nt.links.new(e.outputs[0],nt.nodes['Background'].inputs[0])
m,p=mat('floor',(.6,.6,.6),rough=.9); plane(7,m)
m,p=mat('chrome',(.95,.95,.95),1,.0); bpy.ops.mesh.primitive_uv_sphere_add(segments=128,ring_count=64,radius=.7,location=(-1.6,0,.7)); o=bpy.context.object; smooth(o); put(o,m)
m,p=mat('matt',(.8,.75,.7),0,1); bpy.ops.mesh.primitive_monkey_add(size=1.6,location=(0,-.4,.8),rotation=(-.5,0,.2)); o=bpy.context.object; o.modifiers.new('s','SUBSURF').levels=2; o.modifiers['s'].render_levels=2; smooth(o); put(o,m)
m,p=mat('brushed',(.9,.6,.4),1,.4); bpy.ops.mesh.primitive_uv_sphere_add(segments=128,ring_count=64,radius=.7,location=(1.6,0,.7)); o=bpy.context.object; smooth(o); put(o,m)
camera(s,(0,-6.5,2.2),(0,0,.7)); done(s,'sky')
